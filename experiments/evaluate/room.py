"""Rooms to evaluate on: where their files lie, and what all methods start from in each, made once."""

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

from experiments.reconstruct.config import ReconstructConfig
from rein3d_jax.depth.complete import complete_distance
from rein3d_jax.errors import InputError
from rein3d_jax.io.files.json_file import read_json
from rein3d_jax.io.pictures.image import resize_panorama
from rein3d_jax.io.pictures.panorama import read_panorama
from rein3d_jax.io.rooms.panorama_sets import panorama_sets
from rein3d_jax.io.rooms.traced_room import TracedRoom, read_traced_room
from rein3d_jax.pipeline.pairs import PairConfig, degrade
from rein3d_jax.pipeline.survey import lift_scene, room_background
from rein3d_jax.restore import Background
from rein3d_jax.scene import Gaussians, Panorama, Video

Made = TypeVar("Made")


@dataclass(frozen=True)
class RoomSource:
    """Where a room's files lie: its panorama's, and the scene.json of its ground truth where it has one."""

    name: str
    rgb: Path
    distance: Path
    truth: Path | None = None

    def digest(self) -> str:
        """The hash of all that the room's files hold."""
        digest = hashlib.sha256()
        folder = self.rgb.parent if self.truth is None else self.truth.parent
        files = [self.rgb, self.distance] if self.truth is None else sorted(folder.rglob("*"))
        for path in filter(Path.is_file, files):
            digest.update(f"{path.relative_to(folder)}\0{path.stat().st_size}\0".encode() + path.read_bytes())
        return digest.hexdigest()


def room_sources(folder: str | Path, limit: int | None = None) -> list[RoomSource]:
    """The rooms in `folder`, room2 before room10: folders with a scene.json, or `folder` itself if it holds one; else
    panoramas without ground truth (panorama_sets). Raises InputError if there are none, or at a damaged scene.json."""
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder} is no folder: give --rooms the one that holds the rooms")
    scene = folder / "scene.json"
    scenes = [scene] if scene.exists() else sorted(folder.glob("*/scene.json"), key=_natural)[:limit]
    return [_with_truth(scene) for scene in scenes] or [RoomSource(*files) for files in panorama_sets(folder)[:limit]]


def _with_truth(scene: Path) -> RoomSource:
    read_traced_room(scene)  # a damaged room is found before the long part
    named = read_json(scene)["input"]
    return RoomSource(scene.parent.resolve().name, *(scene.parent / named[kind] for kind in ("rgb", "distance")), scene)


def _natural(path: Path) -> list:
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", path.parent.name)]


def timed(make: Callable[[], Made], *, again: bool = True) -> tuple[Made, float]:
    """What `make` makes, and its seconds, compilation left out: with `again` it is made twice and the second counts."""
    if again:
        jax.block_until_ready(make())
    started = perf_counter()
    made = jax.block_until_ready(make())
    return made, perf_counter() - started


@dataclass(frozen=True)
class EvaluationRoom:
    """A room to evaluate on, at the sizes that the recipe works at; what is made of it is made when first asked for."""

    source: RoomSource
    config: ReconstructConfig

    @property
    def name(self) -> str:
        """That of its source."""
        return self.source.name

    @cached_property
    def traced(self) -> TracedRoom:
        """The room with its ground truth. Raises InputError as read_traced_room does."""
        return read_traced_room(self.source.truth)

    @cached_property
    def given(self) -> Panorama:
        """The input as its files hold it."""
        return read_panorama(self.source.rgb, distance=self.source.distance)

    @cached_property
    def panorama(self) -> Panorama:
        """The input at the rows that the recipe works at, not upsampled, its distance complete."""
        return self._input_at(self.config.input.own_rows(len(self.given.rgb)))

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
            raise InputError(f"{self.source.truth} has no video of two frames: leave out --protocol restoration")
        return jnp.stack([frame.rgb for frame in self.traced.video])

    @cached_property
    def degraded(self) -> tuple[Video, float]:
        """The clip's first frame, lifted, along the video's path; and its seconds."""
        poses = jnp.stack([jnp.asarray(frame.world_from_camera, jnp.float32) for frame in self.traced.video])
        placed = whole(self.clip_input)
        config = PairConfig(height=len(placed.rgb), lift=self.config.lift, rasterize=self.config.rasterize)
        return timed(lambda: degrade(placed, poses, config=config))

    def _input_at(self, height: int) -> Panorama:
        pictures = (np.asarray(x) for x in (self.given.rgb, self.given.distance, self.given.valid))
        rgb, distance, valid = (jnp.asarray(x) for x in resize_panorama(*pictures, height))
        return Panorama(rgb, complete_distance(Panorama(rgb, distance, valid), config=self.config.depth), valid)


def whole(panorama: Panorama) -> Panorama:
    """With its completed distances counted as known, as the main job lifts it."""
    return replace(panorama, valid=jnp.ones(panorama.valid.shape, bool))
