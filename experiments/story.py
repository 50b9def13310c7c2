"""A run's report: which pictures, numbers and warnings a person should see, in which order."""

import dataclasses

import jax.numpy as jnp
import numpy as np

from experiments.inputs import FITTED, InputConfig, View
from experiments.quality import is_novel
from rein3d_jax.evaluate.chart import Chart, Series
from rein3d_jax.evaluate.colour_map import colour_map, colour_range
from rein3d_jax.evaluate.plan import Plan, outline
from rein3d_jax.evaluate.report import Comparison, Picture, Report, Section, Table
from rein3d_jax.explore.profile import ExploreConfig, travel
from rein3d_jax.explore.trajectories import Trajectories
from rein3d_jax.io.image import encode_jpeg
from rein3d_jax.scene import Panorama, Video

SHOWN = 3  # trajectories, and ground-truth positions, that the page shows


@dataclasses.dataclass(frozen=True)
class Run:
    """Everything the report tells of."""

    config: InputConfig
    explore: ExploreConfig
    panorama: Panorama
    origin_of_distance: str
    trajectories: Trajectories
    videos: list[Video]  # restored
    coarse: list[np.ndarray]  # panoramas at the trajectories' ends, holes black
    refined: list[np.ndarray]
    views: list[View]
    coarse_views: list[np.ndarray]
    refined_views: list[np.ndarray]
    curves: dict
    metrics: dict


def tell(run: Run) -> Report:
    """The report of `run`."""
    count, seconds = run.metrics["count"], run.metrics["seconds"]
    facts = [("Gaussians", f"{count['refined']:,}"), ("Seconds", f"{seconds['total']:.0f}")]
    if "quality" in run.metrics:
        facts += [(f"PSNR, {name}", f"{run.metrics['quality'][name]['psnr']:.2f} dB") for name in ("coarse", "refined")]
    return Report(
        title="Your room in 3D",
        summary="One panorama, lifted to 3D, explored, its hidden parts guessed, and everything refined together. "
        "Open viewer.html to walk through it, or scene.ply in any Gaussian splat viewer; flythrough.mp4 walks the "
        "paths below.",
        facts=tuple(facts),
        distance_origin=_distance_origin(run),
        warnings=tuple(_warnings(run)),
        parts=tuple(_parts(run)),
        plan=plan(run),
        charts=_charts(run.curves),
        tables=(Table("Where time went", ("Stage", "Seconds"), tuple((k, f"{s:.1f}") for k, s in seconds.items())),),
        sources=_sources(run.config),
    )


def _distance_origin(run: Run) -> str:
    if run.origin_of_distance != FITTED:
        return "given with the panorama."
    return (
        "room-shell estimate. The photograph came without depth, so an empty box was fitted to its wall, floor and "
        "ceiling edges: furniture is painted onto it, and sizes follow the camera height you set."
    )


def _warnings(run: Run):
    metrics = run.metrics
    if run.origin_of_distance == FITTED:
        yield "The distance is a fitted empty room: furniture will look flat from the side. Give --distance for depth."
    unknown = 1 - float(jnp.mean(run.panorama.valid))
    if unknown > 0.001:
        yield f"{unknown:.1%} of the panorama has no known distance (windows, mirrors); it was placed far away."
    if float(jnp.max(run.trajectories.lengths)) < run.explore.step:
        yield "There was no room to move the camera: nothing hidden was revealed. Lower explore.camera_radius."
    for name, number in metrics["overflows"].items():
        if number:
            yield f"{number} {'frames' if name == 'explore.max_frames' else 'Gaussians'} found no room; raise {name}."


def _parts(run: Run):
    near, far = colour_range(run.panorama.distance, run.panorama.valid)
    depth = colour_map(run.panorama.distance, run.panorama.valid, near, far)
    yield Section("What went in", "The panorama, and how far each pixel is.", (_jpeg("panorama", run.panorama.rgb),
                  _jpeg("distance", depth)), scale=(float(near), float(far)), wide=True)  # fmt: skip
    yield Comparison("Before and after", "Drag: from the end of the longest path, the panorama lifted to 3D alone, "
                     "and the refined scene.", _jpeg("lifted only: black is unseen", run.coarse[0]),
                     _jpeg("refined", run.refined[0]))  # fmt: skip
    for order, index in enumerate(longest(run.trajectories)):
        pictures = [("lifted only: black is unseen", run.coarse[order]), ("restored", run.videos[index].rgb[-1]),
                    ("refined", run.refined[order])]  # fmt: skip
        length = float(run.trajectories.lengths[index])
        yield Section(f"The end of path {index + 1}", f"{length:.1f} m from where the panorama was taken.",
                      tuple(_jpeg(*p) for p in pictures), wide=True)  # fmt: skip
    for index in _shown_views(run):
        pictures = [("lifted only", run.coarse_views[index]), ("refined", run.refined_views[index]),
                    ("truth", run.views[index].rgb)]  # fmt: skip
        yield Section(f"Against the truth: {run.views[index].name}", "A view that the job never saw.",
                      tuple(_jpeg(*p) for p in pictures))  # fmt: skip


def longest(trajectories: Trajectories) -> list[int]:
    """The trajectories that the report shows, longest first."""
    return [int(i) for i in np.argsort(-np.asarray(trajectories.lengths), kind="stable")[:SHOWN]]


def _errors(pictures, views):
    return [np.mean((picture - view.rgb) ** 2) for picture, view in zip(pictures, views, strict=True)]


def _shown_views(run: Run) -> list[int]:
    """Novel views evenly through the list, the worst among them: a report that shows only its best would flatter."""
    novel = [i for i, view in enumerate(run.views) if is_novel(view)]
    if not novel:
        return []
    errors = _errors(run.refined_views, run.views)
    spread = [novel[i] for i in np.linspace(0, len(novel) - 1, SHOWN).astype(int)]
    return sorted({*spread, max(novel, key=lambda i: errors[i])})


def _jpeg(label: str, rgb) -> Picture:
    return Picture(label, encode_jpeg(np.asarray(rgb)))


def plan(run: Run) -> Plan:
    """The map: walls, where one may walk, and the paths."""
    t = run.trajectories
    paths = tuple(np.asarray(p[: int(n), :2]) for p, n in zip(t.positions, t.counts, strict=True))
    places = {tuple(np.round(np.asarray(v.camera.world_from_camera[:2, 3]), 3)) for v in run.views if is_novel(v)}
    views = np.array(sorted(places)).reshape(-1, 2)
    safe = np.asarray(travel(t.safe, config=run.explore))
    return Plan(outline(np.asarray(t.raw)), outline(safe), paths, views)


def _charts(curves: dict) -> tuple[Chart, ...]:
    def series(name, label):
        points = np.array(curves[name], float).reshape(-1, 2)
        return (Series(label, points[:, 0], points[:, 1]),)

    return (
        Chart("Loss", "step", "loss", series("loss", "training views")),
        Chart("PSNR", "step", "dB", series("psnr", "held-out views")),
        Chart("Gaussians", "step", "count", series("count", "alive")),
    )


def _sources(config: InputConfig) -> tuple[str, ...]:
    if not config.panorama.startswith("sample:"):
        return ("Your own picture.",)
    return ("A sample that comes with rein3d_jax; its authors and licences are in experiments/samples/SOURCES.md.",)
