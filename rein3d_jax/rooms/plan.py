"""A room's floor plan: the shell, where the camera stands in it, an alcove's corner block, a partition, a walkway."""

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from rein3d_jax.conventions import EYE_HEIGHT
from rein3d_jax.rooms.config import ROOM_KINDS
from rein3d_jax.rooms.furniture.footprints import NOWHERE, Footprint, distance_from_origin, upright_box

_SIDES = {  # metres, both sides of the plan
    "living_dining": (4.6, 8.0),
    "living": (3.8, 7.5),
    "bedroom": (3.2, 6.0),
    "kitchen": (2.8, 5.5),
    "bathroom": (2.4, 3.8),
}
_HEIGHTS = (2.3, 3.2)  # metres
_DOOR_HEIGHT = 2.05  # metres
STRUCTURE = 4  # boxes: corner block, partition before and behind its doorway, lintel
_CAMERA_CLEARANCE = 0.75  # metres from the camera to structure
_WALKWAY_WIDTH = 0.55  # metres
_WALKWAY_LENGTH = 5.0  # metres
_DIRECTIONS = 16


@struct.dataclass
class Plan:
    """The empty room, in its own axes with the camera at the origin."""

    low: jax.Array  # (3,) metres
    high: jax.Array  # (3,) metres
    structure_low: jax.Array  # (STRUCTURE, 3) metres; an unused box lies NOWHERE
    structure_high: jax.Array  # (STRUCTURE, 3)


def draw_plan(key: jax.Array, kind: jax.Array) -> Plan:
    """A shell of 2.4-8 m by 2.4-8 m and 2.3-3.2 m height around a camera at EYE_HEIGHT, and its structure."""
    sides, height, spot, corner, partition = jax.random.split(key, 5)
    shortest, longest = jnp.asarray(np.array([_SIDES[name] for name in ROOM_KINDS], np.float32))[kind]
    size = jax.random.uniform(sides, (2,), minval=shortest, maxval=longest)
    margin = jnp.minimum(1.0, 0.38 * size)
    behind = margin + (size - 2 * margin) * jax.random.uniform(spot, (2,))
    tall = jax.random.uniform(height, minval=_HEIGHTS[0], maxval=_HEIGHTS[1])
    low = jnp.append(-behind, -EYE_HEIGHT)
    high = jnp.append(size - behind, tall - EYE_HEIGHT)
    boxes = [_corner_block(corner, low, high), *_partition(partition, low, high)]
    return Plan(low, high, jnp.stack([b[0] for b in boxes]), jnp.stack([b[1] for b in boxes]))


def structure_footprints(plan: Plan) -> Footprint:
    """Footprints (STRUCTURE,) of the structure."""
    return upright_box(plan.structure_low, plan.structure_high, plan.low[2])


def _unless(there: jax.Array, low: jax.Array, high: jax.Array):
    return jnp.where(there, low, NOWHERE), jnp.where(there, high, NOWHERE + 0.01)


def _corner_block(key: jax.Array, low: jax.Array, high: jax.Array):
    """A solid corner, which makes the room an L: along x it stays clear of the camera, along y up to half the room."""
    there, wide, deep, sides = jax.random.split(key, 4)
    right, front = jax.random.bernoulli(sides, 0.5, (2,))
    free = jnp.where(right, high[0], -low[0]) - _CAMERA_CLEARANCE
    width = free * jax.random.uniform(wide, minval=0.35, maxval=1.0)
    depth = (high[1] - low[1]) * jax.random.uniform(deep, minval=0.15, maxval=0.5)
    x = jnp.where(right, high[0] - width, low[0]), jnp.where(right, high[0], low[0] + width)
    y = jnp.where(front, high[1] - depth, low[1]), jnp.where(front, high[1], low[1] + depth)
    there = jax.random.bernoulli(there, 0.35) & (width > 0.3)
    return _unless(there, jnp.stack([x[0], y[0], low[2]]), jnp.stack([x[1], y[1], high[2]]))


def _partition(key: jax.Array, low: jax.Array, high: jax.Array):
    """A wall across x or y: a stub from one side, or all across with a doorway under a lintel."""
    there, which, place, length_key, flip, thick, kind = jax.random.split(key, 7)
    axis = jax.random.bernoulli(which, 0.5).astype(jnp.int32)
    ahead = jax.random.bernoulli(flip, 0.5)
    space = jnp.where(ahead, high[axis], -low[axis])
    at = jax.random.uniform(place, minval=_CAMERA_CLEARANCE + 0.1, maxval=jnp.maximum(space - 0.9, 0.9))
    at = jnp.where(ahead, at, -at)
    half = jax.random.uniform(thick, minval=0.04, maxval=0.1)
    side_low, side_high = low[1 - axis], high[1 - axis]
    length = side_high - side_low
    doorway = jax.random.bernoulli(kind, 0.4)
    drawn = jax.random.uniform
    start = jnp.where(doorway, drawn(length_key, minval=0.15, maxval=0.6), drawn(length_key, minval=0.3, maxval=0.7))
    begin = side_low + length * start
    end = begin + 0.9
    exists = jax.random.bernoulli(there, 0.55) & (space > 2.2)
    whole = exists & doorway & (end < side_high - 0.2)

    def piece(there, a, b, z_low, z_high):
        on_y = jnp.array([at - half, a]), jnp.array([at + half, b])
        flat = [jnp.where(axis == 0, x, x[::-1]) for x in on_y]
        return _unless(there, jnp.append(flat[0], z_low), jnp.append(flat[1], z_high))

    top = jnp.minimum(low[2] + _DOOR_HEIGHT, high[2] - 0.1)
    first = piece(exists, side_low, begin, low[2], high[2])
    return first, piece(whole, end, side_high, low[2], high[2]), piece(whole, begin, end, top, high[2])


def draw_walkway(key: jax.Array, plan: Plan) -> Footprint:
    """A strip from the camera, in one of the directions with much space, that furniture leaves free."""
    first, which = jax.random.split(key)
    angle = (jnp.arange(_DIRECTIONS) + jax.random.uniform(first)) * (2 * jnp.pi / _DIRECTIONS)
    way = jnp.stack([jnp.cos(angle), jnp.sin(angle)], -1)
    to_walls = jnp.where(way > 0, plan.high[:2], plan.low[:2]) / jnp.where(jnp.abs(way) < 1e-6, 1e-6, way)
    steps = jnp.linspace(0.3, _WALKWAY_LENGTH, 24)
    inside = steps < to_walls.min(-1)[:, None] - 0.5
    spots = way[:, None] * steps[:, None]
    structure = structure_footprints(plan)
    standing = structure.heights[:, 0] < EYE_HEIGHT
    away = jax.vmap(jax.vmap(lambda spot: distance_from_origin(structure.replace(centre=structure.centre - spot))))(
        spots
    )
    free = inside & jnp.all((away > 0.4) | ~standing, axis=-1)
    length = jnp.max(jnp.where(jnp.cumprod(free, axis=-1) > 0, steps, 0.3), axis=-1)
    best = jnp.argmax(length * jax.random.uniform(which, (_DIRECTIONS,), minval=0.5))
    half = jnp.stack([length[best] / 2, jnp.float32(_WALKWAY_WIDTH / 2)])
    return Footprint((way[best] * length[best] / 2)[None], half[None], way[best][None], jnp.array([[0.03, 1.9]]))
