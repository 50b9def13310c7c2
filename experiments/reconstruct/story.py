"""A run's report: which pictures, numbers and warnings a person should see, in which order."""

import dataclasses
import json
from importlib.resources import files

import jax.numpy as jnp
import numpy as np

from experiments.reconstruct.inputs import FITTED, InputConfig, View
from experiments.reconstruct.quality import is_novel
from experiments.reconstruct.sources import sources
from rein3d_jax.explore.profile import ExploreConfig, travel
from rein3d_jax.explore.trajectories import Trajectories
from rein3d_jax.io.pictures.image import encode_jpeg
from rein3d_jax.report.chart import Chart, Series
from rein3d_jax.report.colour_map import colour_map, colour_range
from rein3d_jax.report.plan import Plan, outline
from rein3d_jax.report.report import Comparison, Picture, Report, Section, Table
from rein3d_jax.report.scatter import Mark, Scatter
from rein3d_jax.scene import Panorama, Video

SHOWN = 3  # trajectories, and ground-truth positions, that the page shows
GUESSED, EMPTY = 0.2, 0.01  # of what surrounds the ends of the paths; above these the page warns


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
        standing=_standing(run.metrics),
        plan=plan(run.trajectories, run.explore, run.views),
        charts=_charts(run.curves),
        tables=(Table("Where time went", ("Stage", "Seconds"), tuple((k, f"{s:.1f}") for k, s in seconds.items())),),
        sources=sources(run.config.panorama),
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
        yield (
            "The scale is a guess: every length follows the height of the camera above the floor. Measure it and give "
            "it with --set shell.camera_height."
        )
    unknown = 1 - float(jnp.mean(run.panorama.valid))
    if unknown > 0.001:
        yield f"{unknown:.1%} of the panorama has no known distance (windows, mirrors); it was placed far away."
    if float(jnp.max(run.trajectories.lengths)) < run.explore.step:
        yield "There was no room to move the camera: nothing hidden was revealed. Lower explore.camera_radius."
    yield from _coverage_warnings(metrics["coverage"])
    for name, number in metrics["overflows"].items():
        if number:
            kind = "frames" if name == "explore.max_frames" else "Gaussians"
            yield f"The capacity was reached: {number:,} {kind} found no room and were left out; raise {name}."
    if len(run.videos) < len(run.trajectories.counts):
        yield (
            f"The seconds of the budget allowed {len(run.videos)} of {len(run.trajectories.counts)} paths; what only "
            "the others show was not guessed. Raise budget.seconds."
        )
    if metrics["skipped_steps"]:
        yield f"{metrics['skipped_steps']} refinement steps had values that were not finite, and were skipped."


def _coverage_warnings(coverage: dict):
    guessed = coverage["refined"] - coverage["coarse"]
    if guessed > GUESSED:
        yield (
            f"{guessed:.0%} of what one sees from the ends of the longest paths was hidden from the panorama and is a "
            "guess. A second panorama taken there would tell."
        )
    if (empty := 1 - coverage["refined"]) > EMPTY:
        yield f"{empty:.0%} of what one sees from the ends of the longest paths is empty: nothing was put there."


def _parts(run: Run):
    near, far = colour_range(run.panorama.distance, run.panorama.valid)
    depth = colour_map(run.panorama.distance, run.panorama.valid, near, far)
    yield Section("What went in", "The panorama, and how far each pixel is.", (_jpeg("panorama", run.panorama.rgb),
                  _jpeg("distance", depth)), scale=(float(near), float(far)), wide=True)  # fmt: skip
    for order, index in enumerate(longest(run.trajectories)):
        yield _path(run, order, index)
    for index in _shown_views(run):
        yield Comparison(f"Against the truth: {run.views[index].name}", "Drag: a view that the job never saw.",
                         _jpeg("refined", run.refined_views[index]), _jpeg("truth", run.views[index].rgb),
                         (_jpeg("lifted only", run.coarse_views[index]),), wide=False)  # fmt: skip


def _path(run: Run, order: int, index: int) -> Comparison:
    length = float(run.trajectories.lengths[index])
    caption = f"Drag: {length:.1f} m from where the panorama was taken, lifted to 3D alone, and refined."
    heading = f"Before and after: the end of path {index + 1}"
    before = _jpeg("lifted only: black is unseen", run.coarse[order])
    guessed = index < len(run.videos) and len(run.videos[index].rgb) == int(run.trajectories.counts[index])
    restored = (_jpeg("what was guessed there before refining", run.videos[index].rgb[-1]),) if guessed else ()
    return Comparison(heading, caption, before, _jpeg("refined", run.refined[order]), restored)


def _standing(metrics: dict) -> Scatter:
    """This run among the methods measured on rooms with ground truth: accuracy against seconds."""
    measured = json.loads(files(__package__).joinpath("measured.json").read_text("utf-8"))
    panel = next(p for p in measured["panels"] if (p["cost"], p["merit"]) == ("seconds", "psnr"))
    seconds = sum(value for name, value in metrics["seconds"].items() if name not in ("write", "total"))
    merit = metrics["quality"]["refined"]["psnr"] if "quality" in metrics else None
    marks = [Mark(point["label"], point["cost"], point["merit"]) for point in panel["points"]]
    own = "this run" if merit is not None else "this run's seconds (no truth to compare with)"
    rooms = len(measured["rooms"])
    caption = (
        f"The other marks are means over {rooms} traced rooms on two cores of a 2.5 GHz Xeon; this run is one scene on "
        "your computer, so compare the order of magnitude. Up and to the left is better."
    )
    return Scatter("Where this run stands", caption, panel["cost_label"], panel["merit_label"],
                   (*marks, Mark(own, seconds, merit, own=True)))  # fmt: skip


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


def plan(trajectories: Trajectories, explore: ExploreConfig, views: list[View]) -> Plan:
    """The map: walls, where one may walk, the paths, and where ground truth was taken."""
    t = trajectories
    paths = tuple(np.asarray(p[: int(n), :2]) for p, n in zip(t.positions, t.counts, strict=True))
    places = {tuple(np.round(np.asarray(v.camera.world_from_camera[:2, 3]), 3)) for v in views if is_novel(v)}
    views = np.array(sorted(places)).reshape(-1, 2)
    safe = np.asarray(travel(t.safe, config=explore))
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
