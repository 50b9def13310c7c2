"""Rooms and the compiled functions that several tests share: compiling is what these tests' time goes into."""

import jax
import jax.numpy as jnp
import pytest

from rein3d_jax.geometry.poses import rigid
from rein3d_jax.geometry.sphere import world_from_camera_axes
from rein3d_jax.rooms.config import RoomConfig
from rein3d_jax.rooms.generate import generate_room
from rein3d_jax.rooms.tracing.trace import trace

ROOMS = 64


@pytest.fixture(scope="session")
def tracer():
    """trace, compiled once for each height and number of samples: always for two frames, the last given one again."""
    compiled = jax.jit(trace, static_argnums=2, static_argnames="samples")

    def traced(room, poses, height, *, samples=1):
        assert len(poses) <= 2
        return compiled(room, jnp.concatenate([poses, poses[-1:]])[:2], height, samples=samples)

    return traced


@pytest.fixture(scope="session")
def many_rooms():
    """ROOMS rooms along a leading axis, their windows closed: every ray has a distance."""
    closed = RoomConfig(open_windows=0.0)
    return jax.jit(jax.vmap(lambda key: generate_room(key, closed)))(jax.random.split(jax.random.key(7), ROOMS))


@pytest.fixture(scope="session")
def room_of(many_rooms):
    """Room by index."""
    return lambda index: jax.tree.map(lambda x: x[index], many_rooms)


@pytest.fixture(scope="session")
def pose_at():
    """world_from_camera of an upright panorama at (x, y, z) metres, yawed RIGHT by radians."""

    def pose(x=0.0, y=0.0, z=0.0, right=0.0):
        c, s = jnp.cos(right), jnp.sin(right)
        yaw = jnp.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        rotation = jnp.matmul(yaw, world_from_camera_axes(), precision="highest")
        return rigid(rotation, jnp.array([x, y, z], jnp.float32))

    return pose


def _without_solids(room):
    empty = {
        name: getattr(room, name).replace(count=jnp.int32(0), casters=jnp.int32(0))
        for name in ("boxes", "cylinders", "ellipsoids")
    }
    return room.replace(**empty)


@pytest.fixture(scope="session")
def without_solids():
    """The room's shell, windows and doors alone."""
    return _without_solids
