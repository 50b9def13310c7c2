"""Panoramas of drawn rooms as training examples: a pure function of a key."""

from functools import partial

import jax
import jax.numpy as jnp

from experiments.train_depth.config import DepthDataConfig
from rein3d_jax.conventions import EYE_HEIGHT
from rein3d_jax.depth.network.loss import DepthExample
from rein3d_jax.geometry.poses import rigid
from rein3d_jax.geometry.sphere import pixel_rays, world_from_camera_axes
from rein3d_jax.rooms.generate import generate_room
from rein3d_jax.rooms.model import Room
from rein3d_jax.rooms.tracing.trace import trace

_UNDER_CEILING = 0.3  # metres that a camera stays below it


@partial(jax.jit, static_argnames="config")
def drawn_examples(keys: jax.Array, config: DepthDataConfig) -> DepthExample:
    """Examples (n, h, 2 h) of n rooms, one at a time, so that its arrays stay in the cache."""
    return jax.lax.map(lambda key: _drawn(key, config), keys)


def _drawn(key: jax.Array, config: DepthDataConfig) -> DepthExample:
    room_key, height_key = jax.random.split(key)
    room = generate_room(room_key, config.rooms)
    rise = jax.random.uniform(height_key, minval=-config.below, maxval=config.above)
    place = jnp.array([0.0, 0.0, 1.0]) * jnp.minimum(rise, room.high[2] - _UNDER_CEILING)
    seen = trace(room, rigid(world_from_camera_axes(), place), config.height)
    camera_height = EYE_HEIGHT + place[2]
    empty = empty_room_distance(room, place, config.height)
    return DepthExample(seen.rgb, seen.distance / camera_height, empty / camera_height)


def empty_room_distance(room: Room, place: jax.Array, height: int) -> jax.Array:
    """Metres (h, 2 h) along the rays of a level panorama at `place` (3,) to the room's floor, ceiling and walls."""
    c, s = jnp.cos(room.yaw), jnp.sin(room.yaw)
    into_room = jnp.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    rays = jnp.matmul(pixel_rays(height, 2 * height), into_room.T, precision="highest")
    start = jnp.matmul(into_room, place, precision="highest")
    reach = jnp.where(rays > 0, room.high - start, start - room.low)
    return jnp.min(reach / jnp.maximum(jnp.abs(rays), 1e-6), axis=-1)
