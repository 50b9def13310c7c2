"""A run's report: which pictures, numbers and warnings a person should see, in which order."""

import json
from importlib.resources import files

import jax.numpy as jnp
import numpy as np

from experiments.reconstruct.pages.sources import sources
from experiments.reconstruct.quality import is_novel
from experiments.reconstruct.run import Pictures, Run
from rein3d_jax.explore.hidden import DOUBTFUL
from rein3d_jax.explore.profile import ExploreConfig, travel
from rein3d_jax.explore.trajectories import Trajectories
from rein3d_jax.io.pictures.image import encode_jpeg
from rein3d_jax.io.rooms.traced_room import View
from rein3d_jax.pipeline.reconstruct import Reconstruction
from rein3d_jax.refine import Curves
from rein3d_jax.report.chart import Chart, Series
from rein3d_jax.report.colour_map import colour_map, colour_range
from rein3d_jax.report.floor_map import FloorMap, outline
from rein3d_jax.report.report import Comparison, Picture, Report, Section, Table
from rein3d_jax.report.scatter import Mark, Scatter

_SHOWN = 3  # trajectories, and ground-truth positions, that the page shows
_GUESSED, _EMPTY = 0.2, 0.01  # of what surrounds the ends of the paths; above these the page warns


def run_report(run: Run, pictures: Pictures, metrics: dict) -> Report:
    """The report of `run`; `metrics` are what metrics.json holds."""
    count, seconds = metrics["count"], metrics["seconds"]
    facts = [("Gaussians", f"{count['refined']:,}"), ("Seconds", f"{seconds['total']:.0f}")]
    if "quality" in metrics:
        facts += [(f"PSNR, {name}", f"{metrics['quality'][name]['psnr']:.2f} dB") for name in ("coarse", "refined")]
    return Report(
        title="Your room in 3D",
        summary="One panorama, lifted to 3D, and what things hide in it guessed; where paths through the room found "
        "holes all the same, these were restored, and everything refined together. "
        "Open viewer.html to walk through it, or scene.ply in any Gaussian splat viewer; flythrough.mp4 walks the "
        "paths below.",
        facts=tuple(facts),
        distance_origin=_distance_origin(run),
        warnings=tuple(_warnings(run, metrics)),
        parts=tuple(_parts(run, pictures)),
        standing=_standing(metrics),
        floor_map=room_plan(run.result.trajectories, run.config.explore, run.views),
        charts=_charts(run.result.curves),
        tables=(Table("Where time went", ("Stage", "Seconds"), tuple((k, f"{s:.1f}") for k, s in seconds.items())),),
        sources=sources(run.config.input.panorama),
    )


def first_report(run: Run) -> Report:
    """The report of a run that has surveyed the panorama, and goes on."""
    return Report(
        title="Your room in 3D: a first look",
        summary="What the panorama saw, lifted to 3D: open viewer.html. What things hide is still black. The job goes "
        "on, and will replace both pages.",
        facts=(("Gaussians", f"{int(run.result.coarse.alive.sum()):,}"),),
        distance_origin=_distance_origin(run),
        warnings=tuple(_warnings_of_input(run)),
        parts=(_went_in(run),),
        floor_map=room_plan(run.result.trajectories, run.config.explore, run.views),
        sources=sources(run.config.input.panorama),
    )


def _distance_origin(run: Run) -> str:
    if not run.estimated:
        return "given with the panorama" + (f": {run.converted}." if run.converted else ".")
    how = {
        "shell": "an empty box was fitted to its wall, floor and ceiling edges: furniture is painted onto it",
        "network": "a network that has seen other rooms said how far each pixel is, and walls were put where the "
        "picture has their lines",
    }[run.config.depth.method]
    said = f"{run.distance_origin}. The photograph came without depth, so {how}"
    told = "a guess" if run.config.input.camera_height is None else "as given"
    said = f"{said}, and sizes follow the camera's height above the floor, {run.config.input.eye_height} m ({told})."
    return f"{said} Of the photograph: {run.converted}." if run.converted else said


def _warnings_of_input(run: Run):
    if run.estimated and run.config.depth.method == "shell":
        yield "The distance is that of an empty room: furniture will look flat from the side. Give --distance."
    if (run.estimated or run.config.input.scaled) and run.config.input.camera_height is None:
        yield (
            "The scale is a guess: every length follows the height of the camera above the floor, for which "
            f"{run.config.input.eye_height} m was taken. Measure it and give it with --set input.camera_height."
        )
    if run.in_doubt:
        yield (
            f"The distance was estimated; for {run.in_doubt:.0%} of the panorama it may be wrong by {DOUBTFUL:.0%} or "
            "more. Cameras keep away from there, and mirrors, glass and what is seen through doors are seldom right."
        )
    unknown = 1 - float(jnp.mean(run.result.panorama.valid))
    if unknown > 0.001:
        yield f"{unknown:.1%} of the panorama has no known distance (windows, mirrors); it was placed far away."
    if float(jnp.max(run.result.trajectories.lengths)) < run.config.explore.step:
        yield "There was no room to move the camera: nothing hidden was revealed. Lower explore.camera_radius."


def _warnings(run: Run, metrics: dict):
    yield from _warnings_of_input(run)
    yield from _coverage_warnings(metrics["coverage"])
    for name, number in metrics["overflows"].items():
        if number:
            kind = "frames" if name == "explore.max_frames" else "Gaussians"
            yield f"The capacity was reached: {number:,} {kind} found no room and were left out; raise {name}."
    if metrics["skipped_steps"]:
        yield f"{metrics['skipped_steps']} refinement steps had values that were not finite, and were skipped."


def _coverage_warnings(coverage: dict):
    guessed = coverage["refined"] - coverage["coarse"]
    if guessed > _GUESSED:
        yield (
            f"{guessed:.0%} of what one sees from the ends of the longest paths was hidden from the panorama and is a "
            "guess. A second panorama taken there would tell."
        )
    if (empty := 1 - coverage["refined"]) > _EMPTY:
        yield f"{empty:.0%} of what one sees from the ends of the longest paths is empty: nothing was put there."


def _went_in(run: Run) -> Section:
    panorama = run.result.panorama
    near, far = colour_range(panorama.distance, panorama.valid)
    depth = colour_map(panorama.distance, panorama.valid, near, far)
    caption = f"The panorama, and how far each pixel is. {run.lean.sentence}"
    pictures_in = (_jpeg("panorama", panorama.rgb), _jpeg("distance", depth))
    if run.in_doubt:
        caption += f" The third picture is doubt: bright where the distance may be wrong by {DOUBTFUL:.0%} or more."
        pictures_in += (_jpeg("doubt", colour_map(panorama.doubt, panorama.valid, 0.0, DOUBTFUL)),)
    return Section("What went in", caption, pictures_in, scale=(float(near), float(far)), wide=True)


def _parts(run: Run, pictures: Pictures):
    yield _went_in(run)
    for order, index in enumerate(longest(run.result.trajectories)):
        yield _path(run.result, index, pictures.coarse_ends[order], pictures.refined_ends[order])
    for index in _shown_views(run.views, pictures.refined_views):
        yield Comparison(f"Against the truth: {run.views[index].name}", "Drag: a view that the job never saw.",
                         _jpeg("refined", pictures.refined_views[index]), _jpeg("truth", run.views[index].rgb),
                         (_jpeg("lifted only", pictures.coarse_views[index]),), wide=False)  # fmt: skip


def _path(result: Reconstruction, index: int, coarse: np.ndarray, refined: np.ndarray) -> Comparison:
    length = float(result.trajectories.lengths[index])
    caption = f"Drag: {length:.1f} m from where the panorama was taken, lifted to 3D alone, and refined."
    heading = f"Before and after: the end of path {index + 1}"
    guessed = index < len(result.videos) and len(result.videos[index].rgb) == int(result.trajectories.counts[index])
    restored = (_jpeg("what was guessed there before refining", result.videos[index].rgb[-1]),) if guessed else ()
    return Comparison(
        heading, caption, _jpeg("lifted only: black is unseen", coarse), _jpeg("refined", refined), restored
    )


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
        f"The other marks are means over {rooms} traced rooms on two cores of an AMD EPYC; this run is one scene on "
        "your computer, so compare the order of magnitude. Up and to the left is better."
    )
    return Scatter("Where this run stands", caption, panel["cost_label"], panel["merit_label"],
                   (*marks, Mark(own, seconds, merit, own=True)))  # fmt: skip


def longest(trajectories: Trajectories) -> list[int]:
    """The trajectories that the report shows, longest first."""
    return [int(i) for i in np.argsort(-np.asarray(trajectories.lengths), kind="stable")[:_SHOWN]]


def _errors(pictures, views):
    return [np.mean((picture - view.rgb) ** 2) for picture, view in zip(pictures, views, strict=True)]


def _shown_views(views: list[View], pictures: list[np.ndarray]) -> list[int]:
    """Novel views evenly through the list, the worst among them: a report that shows only its best would flatter."""
    novel = [i for i, view in enumerate(views) if is_novel(view)]
    if not novel:
        return []
    errors = _errors(pictures, views)
    spread = [novel[i] for i in np.linspace(0, len(novel) - 1, _SHOWN).astype(int)]
    return sorted({*spread, max(novel, key=lambda i: errors[i])})


def _jpeg(label: str, rgb) -> Picture:
    return Picture(label, encode_jpeg(np.asarray(rgb)))


def room_plan(trajectories: Trajectories, explore: ExploreConfig, views: list[View]) -> FloorMap:
    """The room from above: walls, where one may walk, the paths, and where ground truth was taken."""
    t = trajectories
    paths = tuple(np.asarray(p[: int(n), :2]) for p, n in zip(t.positions, t.counts, strict=True))
    places = {tuple(np.round(np.asarray(v.camera.world_from_camera[:2, 3]), 3)) for v in views if is_novel(v)}
    views = np.array(sorted(places)).reshape(-1, 2)
    safe = np.asarray(travel(t.safe, config=explore))
    return FloorMap(outline(np.asarray(t.raw)), outline(safe), paths, views)


def _charts(curves: Curves) -> tuple[Chart, ...]:
    """None where nothing was refined."""
    if not len(curves.psnr):
        return ()

    def series(points, label):
        return (Series(label, points[:, 0], points[:, 1]),)

    return (
        Chart("Loss", "step", "loss", series(curves.loss, "training views")),
        Chart("PSNR", "step", "dB", series(curves.psnr, "held-out views")),
        Chart("Gaussians", "step", "count", series(curves.count, "alive")),
    )
