"""The main job: one panorama in, one explorable scene out.

    python -m experiments.reconstruct --config experiments/recipes/quick.toml [--input pano.jpg]
        [--distance depth.exr] [--output runs/room] [--set stage.key=value ...] [--resume]

Writes scene.ply, viewer.html, flythrough.mp4, report.html, metrics.json and config.toml into the output folder, and
each finished stage into its `stages` folder, from which --resume goes on.
"""

import argparse
import dataclasses
import importlib.metadata
import json
import sys
import time
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from experiments.compile_cache import use_compile_cache
from experiments.config import dump_config, load_config, recipe_digest
from experiments.reconstruct import inputs, run_metrics, story
from experiments.reconstruct.budget import BudgetConfig, Clock, within
from experiments.reconstruct.flythrough import FilmConfig, flythrough
from experiments.reconstruct.inputs import InputConfig, read_panorama, read_views
from experiments.reconstruct.progress import Progress
from experiments.reconstruct.quality import quality, render_views
from experiments.reconstruct.stage_store import StageStore
from experiments.reconstruct.walkthrough import walkthrough
from experiments.restorer_network import read_network, weights_fingerprint
from rein3d_jax.depth.room_shell import RoomShellConfig
from rein3d_jax.errors import InputError
from rein3d_jax.evaluate.coverage import coverage
from rein3d_jax.explore.trajectories import Trajectories, radial_trajectories
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.io.pictures.video import write_mp4
from rein3d_jax.io.splats.ply import write_ply
from rein3d_jax.pipeline.pipeline import (
    Restored,
    Stages,
    collect_views,
    lift_scene,
    refine_scene,
    render_video,
    restore_trajectory,
    room_background,
)
from rein3d_jax.refine import blank_snapshot
from rein3d_jax.report.report import render_report
from rein3d_jax.scene import Gaussians, Panorama, Video

PACKAGES = ("rein3d-jax", "jax", "jaxlib", "flax", "optax", "numpy", "opencv-contrib-python-headless", "OpenImageIO")


@dataclasses.dataclass(frozen=True)
class ReconstructConfig(Stages):
    """The whole job: its input, one config for each stage, where it writes, and its seed."""

    output: str = "runs/room"
    seed: int = 0
    input: InputConfig = InputConfig()
    shell: RoomShellConfig = RoomShellConfig()
    film: FilmConfig = FilmConfig()
    budget: BudgetConfig = BudgetConfig()


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0, or 2 with one line on stderr where the input is at fault."""
    options = _parser().parse_args(arguments)
    use_compile_cache()
    try:
        config = load_config(ReconstructConfig, options.config, _overrides(options))
        reconstruct(config, resume=options.resume)
    except InputError as error:
        print(f"reconstruct: {error}", file=sys.stderr)
        return 2
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m experiments.reconstruct", description=__doc__.splitlines()[0])
    parser.add_argument("--config", required=True, help="a recipe, such as experiments/recipes/quick.toml")
    parser.add_argument("--input", metavar="FILE", help="an equirectangular JPEG, PNG, EXR or HDR (2:1)")
    parser.add_argument("--distance", metavar="FILE", help="metres along each ray: EXR, 16-bit PNG (mm), NPY or NPZ")
    parser.add_argument("--output", metavar="FOLDER", help="where to write (default: the recipe's)")
    parser.add_argument("--set", metavar="KEY=VALUE", action="append", default=[], help="change one key of the recipe")
    parser.add_argument("--resume", action="store_true", help="go on after the last finished stage of this very job")
    return parser


def _overrides(options) -> list[str]:
    """--input, --distance and --output as --set; a picture of one's own has no sample's depth and no ground truth."""
    chosen = []
    if options.input is not None:
        chosen += [f"input.panorama={json.dumps(options.input)}", "input.distance=none", "input.views=none"]
    if options.distance is not None:
        chosen.append(f"input.distance={json.dumps(options.distance)}")
    if options.output is not None:
        chosen.append(f"output={json.dumps(options.output)}")
    return chosen + options.set


def reconstruct(config: ReconstructConfig, *, resume: bool = False) -> dict:
    """Run the job; returns what metrics.json holds. Raises InputError for whatever is wrong with the input."""
    clock, output = Clock(config.budget), Path(config.output)
    views = read_views(config.input)  # a bad view is found before the long part
    files = inputs.fingerprint(config.input)
    write_text(output / "config.toml", _header() + dump_config(config))
    config = within(config, config.budget)
    with Progress(config) as progress:
        store = StageStore(output / "stages", resume=resume, on_done=progress.done)
        result = _stages(config, files, store, progress, clock)
        return _write(config, output, views, store, progress, clock, *result)


def _header() -> str:
    versions = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in PACKAGES)
    return f"# written by rein3d_jax; Python {sys.version.split()[0]}, {versions}; jax on {jax.default_backend()}\n"


def _stages(config: ReconstructConfig, files: str, store: StageStore, progress: Progress, clock: Clock):
    """Everything up to the refined scene, each stage saved when it is done."""
    key = jax.random.key(config.seed)
    table = {field.name: dataclasses.asdict(getattr(config, field.name)) for field in dataclasses.fields(Stages)}
    panorama, fitted = store.run(
        "read",
        [files, config.input.height, table["depth"], dataclasses.asdict(config.shell), jax.__version__],
        (_blank(Panorama, valid=bool), np.zeros(0, bool)),
        lambda: _read(config),
    )
    coarse = store.run("lift", table["lift"], BLANK_SCENE(), lambda: lift_scene(panorama, config.lift))
    trajectories = store.run(
        "explore", table["explore"], BLANK_TRAJECTORIES(), lambda: radial_trajectories(panorama, config=config.explore)
    )
    videos, revealed = [], []
    for last in _restored(config, table, store, panorama, coarse, trajectories, jax.random.fold_in(key, 0), clock):
        videos.append(last.video)
        revealed.append(round(float(last.revealed), 4))

    def refine_all():
        chosen = collect_views(panorama, videos, stages=config)
        refine_key = jax.random.fold_in(key, 1)
        arguments = (last.scene, chosen, panorama, refine_key)
        start = store.kept(blank_snapshot(config.refine))
        told = {"on_step": progress.step, "start": start, "on_look": store.keep, "enough": clock.refined}
        return refine_scene(*arguments, stages=config, **told)

    refined, curves = store.run(
        "refine", table["refine"], (BLANK_SCENE(), blank_snapshot(config.refine).curves), refine_all
    )
    origin = inputs.FITTED if bool(fitted[0]) else inputs.GIVEN
    overflow = {
        "explore.max_frames": int(trajectories.overflow.sum()),
        "lift.capacity": int(last.overflow),
        "refine.spare": int(curves["overflow"]),
    }
    trouble = run_metrics.trouble(overflow, curves)
    chosen = run_metrics.choices(store, revealed, config.explore.trajectories, config.explore.least, curves)
    return panorama, origin, coarse, trajectories, videos, refined, curves, trouble | chosen


def _restored(config, table, store: StageStore, panorama, coarse, trajectories, key, clock):
    """The state after each trajectory, read where it was saved; the first one is never left out."""
    background, last = room_background(panorama, config.restore), None
    network, weights = read_network(config.restore), weights_fingerprint(config.restore)
    for index in range(config.explore.trajectories):
        if index and clock.explored():
            return

        def restore_next(index=index, last=last):
            arguments = (coarse, panorama, trajectories, index, last, key)
            return restore_trajectory(*arguments, stages=config, background=background, network=network)

        depends = [table["restore"], weights, table["rasterize"], config.seed, index]
        last = store.run(f"restore-{index:02d}", depends, _blank_restored(), restore_next)
        yield last


def _read(config: ReconstructConfig):
    panorama, origin = read_panorama(config.input, config.depth, config.shell)
    return panorama, np.array([origin == inputs.FITTED])


def _blank(struct_type, **dtypes):
    """A pytree of the type's structure and dtypes, for reading one back; float32 where not said otherwise."""
    names = [field.name for field in dataclasses.fields(struct_type)]
    return struct_type(**{name: jnp.zeros(0, dtypes.get(name, jnp.float32)) for name in names})


BLANK_SCENE = partial(_blank, Gaussians, alive=bool)
BLANK_TRAJECTORIES = partial(_blank, Trajectories, counts=jnp.int32, overflow=jnp.int32)


def _blank_restored() -> Restored:
    return Restored(BLANK_SCENE(), _blank(Video), jnp.zeros(0), jnp.zeros(0, jnp.int32), jnp.zeros(0, jnp.int32))


def _write(config, output, views, store, progress, clock, panorama, origin, coarse, trajectories, videos, refined,
           curves, told) -> dict:  # fmt: skip
    """scene.ply, flythrough.mp4, viewer.html, report.html, metrics.json, in the order in which one would miss them."""
    begun = time.perf_counter()
    write_ply(output / "scene.ply", refined, antialias=config.rasterize.antialias)
    backdrop = jnp.mean(panorama.rgb, axis=(0, 1))
    film = flythrough(refined, trajectories, backdrop, film=config.film, config=config.rasterize)
    write_mp4(output / "flythrough.mp4", film, config.film.rate)
    pictures = [render_views(scene, views, backdrop, config=config.rasterize) for scene in (coarse, refined)]
    ends = _ends(trajectories)
    (coarse_ends, seen), (refined_ends, covered) = (_panoramas(scene, ends, config) for scene in (coarse, refined))
    metrics = {
        **run_metrics.cost(store),
        **run_metrics.size(panorama, coarse, refined, output / "scene.ply"),
        **told,
        "distance": origin,
        "recipe": recipe_digest(output / "config.toml"),
        "coverage": {"coarse": round(seen, 4), "refined": round(covered, 4)},
    }
    if views:
        metrics["quality"] = {n: quality(p, views) for n, p in zip(("coarse", "refined"), pictures, strict=True)}
    metrics["seconds"]["write"] = round(time.perf_counter() - begun, 3)
    metrics["seconds"]["total"] = round(clock.elapsed(), 3)
    run = story.Run(config.input, config.explore, panorama, origin, trajectories, videos, coarse_ends, refined_ends,
                    views, *pictures, curves, metrics)  # fmt: skip
    write_text(output / "viewer.html", walkthrough(run, coarse, refined, backdrop, config.rasterize.filter_variance))
    write_text(output / "report.html", render_report(story.tell(run)))
    write_text(output / "metrics.json", json.dumps(metrics, indent=2) + "\n")
    progress.finish(output, metrics)
    return metrics


def _ends(trajectories: Trajectories) -> jax.Array:
    """(k, 4, 4) poses at the ends of the longest trajectories."""
    chosen = story.longest(trajectories)
    return jnp.stack([trajectories.world_from_camera[i, int(trajectories.counts[i]) - 1] for i in chosen])


def _panoramas(scene: Gaussians, poses: jax.Array, config: ReconstructConfig) -> tuple[list, float]:
    """What the scene shows there, holes black; and the share of the sphere that it covers, the poses' mean."""
    video, _ = render_video(scene, poses, config.restore.height, config.rasterize)
    return list(np.asarray(video.rgb * video.alpha[..., None])), float(jnp.mean(coverage(video.alpha)))


if __name__ == "__main__":
    sys.exit(main())
