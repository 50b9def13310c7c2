"""Evaluation viewpoints spread over the safe area (paper, Algorithm 2)."""

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.explore.profile import ExploreConfig, travel
from rein3d_jax.geometry.poses import upright
from rein3d_jax.geometry.sphere import azimuths, horizontal_direction

_YAWS = (0.0, 0.5 * jnp.pi, jnp.pi, 1.5 * jnp.pi)  # radians, turning left (Algorithm 2, line 25)


@struct.dataclass
class Viewpoints:
    """The origin, then points each as far as can be from those before; an invalid one stands at the origin."""

    positions: jax.Array  # (n + 1, 3) metres, world
    valid: jax.Array  # (n + 1,) bool; False where the candidates ran out
    world_from_camera: jax.Array  # (n + 1, 4, 4, 4) OpenCV axes, by point and yaw


def _candidates(key: jax.Array, safe: jax.Array, config: ExploreConfig) -> tuple[jax.Array, jax.Array]:
    """Points (m, 3) and whether they count (m,): r = R_max sqrt(u), uniform in area within a column's sector (lines
    2 to 11)."""
    column_key, radius_key = jax.random.split(key)
    column = jax.random.randint(column_key, (config.viewpoint_samples,), 0, safe.shape[0])
    usable = travel(safe, config=config)[column]
    radius = usable * jnp.sqrt(jax.random.uniform(radius_key, column.shape))
    return radius[:, None] * horizontal_direction(azimuths(safe.shape[0])[column]), usable > config.min_viewpoint_travel


def _farthest_points(candidates: jax.Array, usable: jax.Array, count: int) -> tuple[jax.Array, jax.Array]:
    """Points (count, 3) and whether they are valid (count,): each the candidate farthest from the origin and all before
    (lines 12 to 22). A candidate already taken is at distance 0 and is never taken again."""

    def take(nearest: jax.Array, _: None) -> tuple[jax.Array, tuple[jax.Array, jax.Array]]:
        best = jnp.argmax(nearest)
        valid = nearest[best] > 0
        point = jnp.where(valid, candidates[best], 0.0)
        return jnp.minimum(nearest, jnp.linalg.norm(candidates - point, axis=-1)), (point, valid)

    start = jnp.where(usable, jnp.linalg.norm(candidates, axis=-1), 0.0)
    return jax.lax.scan(take, start, length=count)[1]


def _evaluation_viewpoints(key: jax.Array, safe: jax.Array, *, config: ExploreConfig = ExploreConfig()) -> Viewpoints:
    """Level viewpoints, `config.viewpoints` + 1 of them, four yaws each, from the safe profile (w,) in metres of
    Trajectories.safe (Algorithm 2, whole). Without usable room only the origin is valid."""
    points, valid = _farthest_points(*_candidates(key, safe, config), config.viewpoints)
    positions = jnp.concatenate([jnp.zeros((1, 3)), points])
    by_yaw = jax.vmap(upright, (None, 0))
    return Viewpoints(
        positions=positions,
        valid=jnp.concatenate([jnp.ones(1, bool), valid]),
        world_from_camera=jax.vmap(by_yaw, (0, None))(positions, jnp.array(_YAWS)),
    )


evaluation_viewpoints = jax.jit(_evaluation_viewpoints, static_argnames=("config",))
