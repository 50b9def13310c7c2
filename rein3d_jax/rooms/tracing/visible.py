"""Whether places in a room are seen from elsewhere in it."""

import jax
import jax.numpy as jnp

from rein3d_jax.rooms.model import Room
from rein3d_jax.rooms.tracing.nearest import nearest, room_from_world
from rein3d_jax.rooms.tracing.vectors import components

_SAME = 0.02  # metres before a point at which a ray has reached it


def visible(room: Room, origin: jax.Array, points: jax.Array) -> jax.Array:
    """Whether nothing stands between `origin` (3,), inside the shell, and `points` (..., 3), world, metres: (...) bool.

    Pure; works under jit and vmap."""
    away = points - origin
    length = jnp.linalg.norm(away, axis=-1)
    rays = away / jnp.maximum(length, 1e-6)[..., None]
    into_room = room_from_world(room)
    start, rays = (jnp.matmul(x, into_room.T, precision="highest") for x in (origin, rays))
    met, _ = nearest(room, components(start), components(rays))
    return met > length - _SAME
