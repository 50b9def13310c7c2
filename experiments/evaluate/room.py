"""Rooms with ground truth: where they lie, and what all methods start from in each, made once."""

import hashlib
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from time import perf_counter
from typing import TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from experiments.reconstruct.__main__ import ReconstructConfig
from rein3d_jax.depth.complete import complete_distance
from rein3d_jax.errors import InputError
from rein3d_jax.io.pictures.image import resize_panorama
from rein3d_jax.io.rooms.traced_room import TracedRoom, read_traced_room
from rein3d_jax.pipeline.pairs import PairConfig, degrade
from rein3d_jax.pipeline.pipeline import lift_scene, room_background
from rein3d_jax.restore import Background
from rein3d_jax.scene import Gaussians, Panorama, Video

Made = TypeVar("Made")


def room_folders(folder: str | Path, limit: int | None = None) -> list[Path]:
    """The folders in `folder` that hold a scene.json, room2 before room10; or `folder` itself if it holds one.
    Raises InputError if there is none."""
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder} is no folder: give --rooms the one that holds the rooms")
    if (folder / "scene.json").exists():
        return [folder]
    found = sorted((path.parent for path in folder.glob("*/scene.json")), key=_natural)[:limit]
    if not found:
        raise InputError(
            f"{folder} holds no room: --rooms needs folders with a scene.json, as ../shared/rooms has them"
        )
    return found


def _natural(path: Path) -> list:
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", path.name)]


def fingerprint(folder: Path) -> str:
    """What the room's files hold, as one hash."""
    digest = hashlib.sha256()
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        digest.update(f"{path.relative_to(folder)}\0{path.stat().st_size}\0".encode() + path.read_bytes())
    return digest.hexdigest()


def timed(make: Callable[[], Made], *, again: bool = True) -> tuple[Made, float]:
    """What `make` makes, and its seconds, compilation left out: with `again` it is made twice and the second counts."""
    if again:
        jax.block_until_ready(make())
    started = perf_counter()
    made = jax.block_until_ready(make())
    return made, perf_counter() - started


@dataclass(frozen=True)
class Room:
    """A room under test, at the sizes that the recipe works at. All that is made of it is made when first asked for."""

    folder: Path
    config: ReconstructConfig

    @property
    def name(self) -> str:
        """The folder's."""
        return self.folder.resolve().name

    @cached_property
    def traced(self) -> TracedRoom:
        """What its folder holds. Raises InputError as read_traced_room does."""
        return read_traced_room(self.folder)

    @cached_property
    def panorama(self) -> Panorama:
        """The input at the recipe's height, its distance complete."""
        return self._input_at(self.config.input.height)

    @cached_property
    def backdrop(self) -> jax.Array:
        """(3,) what stands where nothing is shown: the input's mean colour, as in the main job's metrics."""
        return jnp.mean(self.panorama.rgb, axis=(0, 1))

    @cached_property
    def coarse(self) -> tuple[Gaussians, float]:
        """The lifted scene, and its seconds."""
        return timed(lambda: lift_scene(self.panorama, self.config.lift))

    @cached_property
    def background(self) -> tuple[Background | None, float]:
        """The room's shell with its colours, and its seconds."""
        return timed(lambda: room_background(self.panorama, self.config.restore))

    @cached_property
    def clip_input(self) -> Panorama:
        """The input at the video's height, as a clip's first frame."""
        return self._input_at(len(self.traced.video[0].rgb))

    @cached_property
    def clip_rgb(self) -> jax.Array:
        """(t, h, w, 3) the clean video. Raises InputError if the room has none."""
        if len(self.traced.video) < 2:
            raise InputError(f"{self.folder}/scene.json has no video of two frames: leave out --protocol restoration")
        return jnp.stack([frame.rgb for frame in self.traced.video])

    @cached_property
    def degraded(self) -> tuple[Video, float]:
        """The clip's first frame, lifted, along the video's path; and its seconds."""
        poses = jnp.stack([jnp.asarray(frame.world_from_camera, jnp.float32) for frame in self.traced.video])
        placed = whole(self.clip_input)
        config = PairConfig(height=len(placed.rgb), lift=self.config.lift, rasterize=self.config.rasterize)
        return timed(lambda: degrade(placed, poses, config=config))

    def _input_at(self, height: int) -> Panorama:
        given = self.traced.input.panorama
        pictures = (np.asarray(x) for x in (given.rgb, given.distance, given.valid))
        rgb, distance, valid = (jnp.asarray(x) for x in resize_panorama(*pictures, height))
        return Panorama(rgb, complete_distance(distance, valid, config=self.config.depth), valid)


def whole(panorama: Panorama) -> Panorama:
    """With its completed distances counted as known, as the main job lifts it."""
    return replace(panorama, valid=jnp.ones(panorama.valid.shape, bool))
