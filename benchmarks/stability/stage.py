"""Rooms made to measure: a shell of a given size with textures drawn by seed, even light, and boxes where they are put.
The room's axes are the world's, its origin the middle of the floor."""

from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.stability.case import CLOSED, Case, case_of
from rein3d_jax.rooms.furniture.footprints import NOWHERE
from rein3d_jax.rooms.generate import generate_room
from rein3d_jax.rooms.materials import GROUP_INDEX, draw_textures
from rein3d_jax.rooms.model import Room

EYE = 1.6  # metres above the floor
_SHELL = ("floor", "ceiling", "accent", "wallpaper", "accent", "picture")
_PIECES = ("furniture", "soft", "front", "stone", "rug", "linen", "object", "pillow")
FIRST_PIECE = 10  # after six faces and four openings, which are not there


@dataclass(frozen=True)
class Stage:
    """What stands where: metres."""

    size: tuple[float, float, float] = (5.0, 4.0, 2.6)
    camera: tuple[float, float, float] = (0.0, 0.0, EYE)
    boxes: tuple[tuple[tuple[float, ...], tuple[float, ...]], ...] = ()  # centre and half size of each


def staged_room(stage: Stage, seed: int) -> Room:
    """The room, its origin at the camera."""
    room = _blank(jax.random.fold_in(jax.random.key(7), seed))
    half, camera = np.array(stage.size) / 2, np.array(stage.camera)
    floor = np.array([0.0, 0.0, half[2]])  # from the floor's middle to the room's
    count, capacity = len(stage.boxes), room.boxes.half.shape[0]
    centre, extent = np.full((capacity, 3), NOWHERE), np.full((capacity, 3), 0.01)
    for row, (middle, reach) in enumerate(stage.boxes):
        centre[row], extent[row] = np.array(middle) - camera, reach
    solids = room.boxes.replace(
        centre=jnp.asarray(centre, jnp.float32), half=jnp.asarray(extent, jnp.float32),
        heading=jnp.tile(jnp.array([1.0, 0.0]), (capacity, 1)),
        texture=FIRST_PIECE + jnp.arange(capacity) % len(_PIECES), object=FIRST_PIECE + jnp.arange(capacity),
        count=jnp.int32(count), casters=jnp.int32(0),
    )  # fmt: skip
    low, high = (jnp.asarray(floor - camera + side * half, jnp.float32) for side in (-1, 1))
    return room.replace(low=low, high=high, boxes=solids)


@partial(jax.jit)
def _blank(key: jax.Array) -> Room:
    """An empty room under even light: only ambient, which is darker in corners."""
    room = generate_room(key, CLOSED)
    names = [*_SHELL, *["leaf_of_door"] * 4, *_PIECES]
    textures = draw_textures(key, jnp.array([GROUP_INDEX[name if name in GROUP_INDEX else "wall"] for name in names]))
    none = jnp.int32(0)
    empty = {name: getattr(room, name).replace(count=none, casters=none) for name in ("cylinders", "ellipsoids")}
    return room.replace(
        yaw=jnp.float32(0), **empty, textures=textures,
        openings=room.openings.replace(centre=jnp.full_like(room.openings.centre, NOWHERE)),
        lights=room.lights.replace(power=jnp.zeros_like(room.lights.power)),
        ambient=jnp.array([[0.8] * 3, [1.0] * 3]), exposure=jnp.float32(1.2), gamma=jnp.float32(1),
        open_windows=jnp.asarray(False),
    )  # fmt: skip


def staged_case(stage: Stage, seed: int) -> Case:
    """The room as a case."""
    return case_of(staged_room(stage, seed))


def scattered(count: int, seed: int, stage: Stage = Stage(), *, width: float = 0.0) -> Stage:
    """The stage with `count` boxes on its floor, clear of the camera; posts of `width` metres where that is given."""
    rng, boxes = np.random.default_rng([seed, 5]), []
    half = np.array(stage.size)[:2] / 2
    while len(boxes) < count:
        reach = rng.uniform((0.1, 0.1, 0.1), (0.4, 0.4, 0.6))
        if width:
            reach = np.array([width / 2, width / 2, 0.6])
        spot = rng.uniform(-half + reach[:2], half - reach[:2])
        if np.hypot(*np.maximum(np.abs(spot - stage.camera[:2]) - reach[:2], 0)) > 0.5:
            boxes.append(((*spot, reach[2]), tuple(reach)))
    return Stage(stage.size, stage.camera, tuple(boxes))


def partitioned(rooms: int) -> Stage:
    """`rooms` rooms in a row along +X behind each other's doors, the camera in the first."""
    depth, boxes = 3.0, []
    for number in range(1, rooms):
        at = number * depth - (rooms * depth) / 2
        boxes += [((at, side * 1.25, 1.3), (0.06, 0.75, 1.3)) for side in (-1, 1)]
        boxes.append(((at, 0.0, 2.33), (0.06, 0.5, 0.27)))
    return Stage((rooms * depth, 4.0, 2.6), (1.2 - rooms * depth / 2, 0.0, EYE), tuple(boxes))
