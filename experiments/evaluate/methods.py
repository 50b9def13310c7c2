"""What is compared, by name: the lifted scene, each restorer's fill over it, the refined scene, and a mesh."""

import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from experiments.evaluate.mesh_warp import mesh_warp
from experiments.evaluate.renderer import Renderer, filled_renderer, scene_renderer, with_panoramas
from experiments.evaluate.room import EvaluationRoom, timed, whole
from experiments.reconstruct.config import ReconstructConfig
from experiments.reconstruct.flythrough import FilmConfig
from experiments.reconstruct.inputs import InputConfig
from experiments.reconstruct.job import run_job
from rein3d_jax.errors import InputError
from rein3d_jax.io.splats.ply import read_ply
from rein3d_jax.networks.trained import read_network
from rein3d_jax.restore import restorer
from rein3d_jax.restore.restorer import DIFFUSION, LEARNED, METHODS, Restorer
from rein3d_jax.scene import Camera, Gaussians

COARSE, MESH, REFINED = "coarse", "mesh_warp", "refined"
BLIND = ("telea", "navier_stokes")  # fills that know nothing of the room
ANCHORED = (LEARNED, DIFFUSION)  # restorers that compare each frame with the first
RESTORERS = tuple(name for name in METHODS if name != "none")
OF_CLIPS = (COARSE, *RESTORERS, MESH)
OF_SCENES = (COARSE, *RESTORERS, MESH, REFINED)


class Built(NamedTuple):
    """A method, ready to render."""

    render: Renderer
    seconds: float  # from the panorama in memory to here
    size: dict[str, int]  # gaussians, or triangles


def chosen_methods(names: Sequence[str] | None, offered: Sequence[str]) -> list[str]:
    """Those of `names` that are `offered`, or all but the one whose weights do not come with the package. Raises
    InputError for one that no protocol knows."""
    for name in names or ():
        if name not in OF_SCENES:
            raise InputError(f'--methods: "{name}" is unknown; choose from {", ".join(OF_SCENES)}')
    return [name for name in offered if (name != DIFFUSION if names is None else name in names)]


def build(method: str, room: EvaluationRoom, cameras: Sequence[Camera], runs: Path) -> Built:
    """A method for a room, ready to render for `cameras`. The refined scene is made by the main job in `runs`, which
    takes minutes, or found finished there."""
    if method == MESH:
        mesh, seconds = timed(lambda: mesh_warp(whole(room.panorama)))
        return Built(mesh, seconds, {"triangles": mesh.triangles})
    if method == REFINED:
        return _of_scene(*_refined(room, runs / room.name), room, cameras)
    if method == COARSE:
        return _of_scene(*room.coarse, room, cameras)
    config = room.config.restore
    coarse = _of_scene(*room.coarse, room, with_panoramas(cameras, config.height))
    fill, seconds = fill_of(method, room)
    anchored = method in ANCHORED
    render = filled_renderer(coarse.render, fill, rows=config.height, observed=config.observed, anchored=anchored)
    return coarse._replace(render=render, seconds=coarse.seconds + seconds)


def fill_of(method: str, room: EvaluationRoom) -> tuple[Restorer, float]:
    """The restorer of that name with the recipe's settings, and the seconds of what it knows beforehand."""
    background, seconds = room.background
    config = dataclasses.replace(room.config.restore, method=method)
    return restorer(config, background, read_network(config)), 0.0 if method in BLIND else seconds


def _of_scene(gaussians: Gaussians, seconds: float, room: EvaluationRoom, cameras: Sequence[Camera]) -> Built:
    render = scene_renderer(gaussians, cameras, room.config.rasterize)
    return Built(render, seconds, {"gaussians": int(gaussians.alive.sum())})


def _refined(room: EvaluationRoom, output: Path) -> tuple[Gaussians, float]:
    """The main job's scene and its seconds without the writing, compilation included: as a user waits for it."""
    files = {"panorama": str(room.source.rgb), "distance": str(room.source.distance)}
    given = room.config.input
    config: ReconstructConfig = dataclasses.replace(
        room.config,
        output=str(output),
        # The truth is in the picture's own frame, and it stands level.
        input=InputConfig(**files, views=None, height=given.height, upsample=given.upsample, level=False),
        film=FilmConfig(width=16, height=16, step=10.0, yaw_step=3.0),  # nobody watches it
    )
    metrics = run_job(config, resume=True)
    seconds = sum(spent for stage, spent in metrics["seconds"].items() if stage not in ("write", "total"))
    return read_ply(output / "scene.ply"), seconds


def recipe_of(config: ReconstructConfig) -> dict:
    """The part of a recipe that a result depends on, for JSON: all but where the main job reads and writes."""
    read = {"height": config.input.height, "upsample": config.input.upsample}
    table = dataclasses.asdict(config) | {"input": read}
    return {name: json.loads(json.dumps(value)) for name, value in table.items() if name not in ("output", "film")}
