"""The main job on files: reads, runs the stages, saves each when it is done, writes what a person opens."""

import contextlib
import dataclasses
import importlib.metadata
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import jax
import numpy as np

from experiments.config import dump_config
from experiments.machine import machine_bytes
from experiments.reconstruct.budget import check_memory, foreseen_bytes, within
from experiments.reconstruct.config import ReconstructConfig
from experiments.reconstruct.diffusion_cost import restore_bytes, told_cost
from experiments.reconstruct.forecast import SecondsForecast
from experiments.reconstruct.inputs import input_fingerprint, input_views, levelled_views, picture_rows, told_panorama
from experiments.reconstruct.outputs import write_outputs
from experiments.reconstruct.pages.first_look import write_first_look
from experiments.reconstruct.plans import planned
from experiments.reconstruct.progress import Progress
from experiments.reconstruct.run import Run
from experiments.reconstruct.stage_store import StageStore
from rein3d_jax.depth.level import Lean
from rein3d_jax.explore.trajectories import radial_trajectories
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.lift import LiftConfig
from rein3d_jax.networks.depth import read_depth_network
from rein3d_jax.networks.trained import files_digest, read_network, require_network, weights_fingerprint
from rein3d_jax.networks.upsampler import read_upsampler, upsampler_fingerprint
from rein3d_jax.pipeline.explore_and_restore import Explored, explore_and_restore, lightly
from rein3d_jax.pipeline.peel_scene import peel_scene
from rein3d_jax.pipeline.reconstruct import Reconstruction, joined
from rein3d_jax.pipeline.refine_scene import collect_views, refine_scene, where_it_pays
from rein3d_jax.pipeline.survey import Survey, lift_scene, room_background, survey, with_distance
from rein3d_jax.refine import Snapshot
from rein3d_jax.restore import restorer
from rein3d_jax.upsample import NONE, then_upsample

PACKAGES = ("rein3d-jax", "jax", "jaxlib", "flax", "optax", "numpy", "opencv-contrib-python-headless", "OpenImageIO")


@dataclasses.dataclass(frozen=True)
class _Job:
    """What its stages share."""

    config: ReconstructConfig
    of_picture: int  # rows, in its file
    store: StageStore
    progress: Progress

    def stage(self, name: str, depends, make):
        """The result of a stage, shown to whoever watches."""
        result = self.store.run(name, depends, make)
        self.progress.done(self.store.finished[-1])
        return result

    def look(self, known: Survey, about: Sequence) -> None:
        """Writes the pages of what is known, for the first look, unless those of an earlier job stand there: they stay
        until this one has better. `about` is whether the distance was estimated, what was done to a given one, and how
        the picture leaned."""
        if not self.progress.looked and (Path(self.config.output) / "viewer.html").exists():
            return
        estimated, told, lean = about
        write_first_look(Run(self.config, known, bool(estimated), told, [], lean))
        self.progress.look(Path(self.config.output))

    def settings(self, stage: str) -> dict:
        """Those of a stage, as its key takes them."""
        return dataclasses.asdict(getattr(self.config, stage))


def run_job(config: ReconstructConfig, *, resume: bool = False) -> dict:
    """Run the job; returns what metrics.json holds. Raises InputError for whatever is wrong with the input."""
    started, output = time.perf_counter(), Path(config.output)
    views = input_views(config.input)  # a bad view is found before the long part, and so are bad weights
    require_network(config.restore)
    of_picture = picture_rows(config.input)
    config, plan = planned(config, lambda config: _forecast(config, of_picture).seconds()["total"])
    rows = config.input.rows(of_picture)
    check_memory(rows, machine_bytes(), lambda rows: _bytes(config, rows))
    files = input_fingerprint(config.input)
    forecast = _forecast(config, of_picture)
    foreseen = {"foreseen_seconds": forecast.seconds(), "foreseen_bytes": _bytes(config, rows)}
    write_text(output / "config.toml", _header() + dump_config(config))
    config = within(config, config.budget)
    with Progress(config, **foreseen) as progress:
        progress.tell(f'the plan for {config.budget.seconds:g} s: "{plan}"' if plan else "")
        progress.tell(told_cost(config))
        store = StageStore(output / "stages", config.refine, resume=resume)
        job = _Job(config, of_picture, store, progress)
        *made, lean = _stages(job, files)
        run = Run(config, *made, levelled_views(views, lean), lean)
        metrics = write_outputs(run, store, started, foreseen | {"plan": plan})
        progress.finish(output, metrics)
    if not any(stage.found for stage in store.finished):
        forecast.remember(metrics["seconds"], metrics["program_seconds"])
    return metrics


def _forecast(config: ReconstructConfig, of_picture: int) -> SecondsForecast:
    rows = config.input.rows(of_picture)
    return SecondsForecast(config, rows, upsampled=config.input.doublings(of_picture) > 0)


def _bytes(config: ReconstructConfig, rows: int) -> int:
    """Foreseen, the restorer's network among them."""
    return foreseen_bytes(rows, config.lift.share, estimated=config.asks_network) + restore_bytes(config)


def _header() -> str:
    versions = ", ".join(_versions())
    return f"# written by rein3d_jax; Python {sys.version.split()[0]}, {versions}; jax on {jax.default_backend()}\n"


def _versions():
    """Of the packages that are installed: a checkout may run uninstalled, and one OpenCV may stand for another."""
    for name in PACKAGES:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            yield f"{name} {importlib.metadata.version(name)}"


def _stages(job: _Job, files: str) -> tuple[Reconstruction, bool, str, Lean]:
    """Everything up to the refined scene; whether the distance was estimated, what was done to a given one, and how the
    picture leaned."""
    config, key = job.config, jax.random.key(job.config.seed)
    weights = files_digest(config.depth_weights) if config.asks_network else ""
    given = config.input
    depends = [
        files,
        *(given.height, given.level, given.pose, given.eye_height, given.upsample),
        *(given.distance_kind, given.distance_unit, given.scale),
        upsampler_fingerprint(given.upsample),
        job.settings("depth"),
        job.settings("shell"),
        weights,
        jax.__version__,
    ]
    panorama, *about = job.stage("read", depends, lambda: _read(job))
    coarse = job.stage("lift", job.settings("lift"), lambda: lift_scene(panorama, config.lift))
    trajectories = job.stage(
        "explore", job.settings("explore"), lambda: radial_trajectories(panorama, config=config.explore)
    )
    known = Survey(panorama, coarse, trajectories)
    job.look(known, about)
    explored = lightly(_explored(job, known, key))
    scene, curves, stopped = job.stage(
        "refine", job.settings("refine"), lambda: _refined(job, known, explored, jax.random.fold_in(key, 1))
    )
    return joined(known, explored, (scene, curves, stopped)), bool(about[0]), *about[1:]


def _read(job: _Job):
    """The panorama, whether its distance was estimated, what was done to a given one, how it leaned. While the network
    makes it finer, what it is shows itself."""
    config = job.config
    if not config.input.doublings(job.of_picture):
        return _told(config)
    as_it_is = dataclasses.replace(config, input=dataclasses.replace(config.input, upsample=NONE))
    with ThreadPoolExecutor(1) as beside:
        finer = beside.submit(_told, config)
        panorama, *about = _told(as_it_is)
        job.look(survey(panorama, dataclasses.replace(config, lift=LiftConfig())), about)
        return finer.result()


def _told(config: ReconstructConfig):
    network = read_depth_network(config.depth_weights) if config.asks_network else None
    panorama, told, lean = told_panorama(config.input, read_upsampler(config.input.upsample))
    panorama, estimated = with_distance(panorama, config, network, camera_height=config.input.eye_height)
    return panorama, np.array([estimated]), told, lean


def _explored(job: _Job, known: Survey, key: jax.Array) -> Iterator[Explored]:
    """The state after each trajectory, read where it was saved; the first one is never left out."""
    config, last = job.config, None
    background = room_background(known.panorama, config.restore)
    restore = restorer(config.restore, background, read_network(config.restore))
    made_by = [job.settings("restore"), weights_fingerprint(config.restore), config.seed]
    peel_key = jax.random.fold_in(key, 2)
    scene = job.stage(
        "peel",
        [job.settings("peel"), *made_by],
        lambda: peel_scene(known, background, restore, peel_key, stages=config),
    )
    peeled, method = known.replace(coarse=scene), config.upsample.method
    restore = then_upsample(restore, known.panorama, read_upsampler(method), config=config.upsample)
    shared = [*made_by, job.settings("upsample"), upsampler_fingerprint(method), job.settings("rasterize")]
    for index in range(config.explore.trajectories):
        states = explore_and_restore(peeled, restore, jax.random.fold_in(key, 0), stages=config, start=last)
        last = job.stage(f"restore-{index:02d}", [*shared, index], lambda states=states: next(states))
        yield last


def _refined(job: _Job, known: Survey, explored: list[Explored], key: jax.Array):
    """(scene, curves, why it ended), a snapshot saved at each held-out evaluation."""
    panorama, videos = known.panorama, [state.video for state in explored]
    config = where_it_pays(job.config, videos)
    views = collect_views(panorama, videos, stages=config)
    unfinished: Snapshot | None = job.store.unfinished()
    start = explored[-1].scene if unfinished is None else unfinished
    for last in refine_scene(start, views, panorama, key, stages=config):
        job.progress.step(last.step)
        if last.evaluated and not last.stopped:
            job.store.save_unfinished(last)
    return last.scene, last.curves, last.stopped
