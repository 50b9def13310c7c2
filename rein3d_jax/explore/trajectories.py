"""Radial trajectories through the safe area (paper, Algorithm 1).

Every frame keeps the input panorama's orientation; only the position moves, on the horizon plane of the origin.
"""

import math

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.explore.profile import ExploreConfig, band_profile, safe_distances, travel
from rein3d_jax.geometry.poses import rigid
from rein3d_jax.geometry.sphere import azimuths, horizontal_direction, world_from_camera_axes
from rein3d_jax.scene import Panorama


@struct.dataclass
class Trajectories:
    """Paths, tau of them, in buffers of f frames; frames from `counts` on repeat the path's last one."""

    positions: jax.Array  # (tau, f, 3) metres, world; frame 0 is the origin
    world_from_camera: jax.Array  # (tau, f, 4, 4) OpenCV axes
    counts: jax.Array  # (tau,) int, frames in use, at least 1
    overflow: jax.Array  # (tau,) int, points of the path that did not fit into f
    directions: jax.Array  # (tau,) azimuth phi, radians turning right
    lengths: jax.Array  # (tau,) metres, l: how far the path may go
    rotation: jax.Array  # () radians, theta*
    raw: jax.Array  # (w,) metres, D_raw by column
    safe: jax.Array  # (w,) metres, D_safe by column


@jax.jit
def path_ends(paths: Trajectories) -> jax.Array:
    """world_from_camera (tau, 4, 4) of each path's last frame."""
    return paths.world_from_camera[jnp.arange(len(paths.counts)), paths.counts - 1]


def _fan(rotation: jax.Array, count: int) -> jax.Array:
    """Directions (..., tau) of an even fan: phi_i = theta + i 2 pi / tau."""
    return rotation[..., None] + jnp.arange(count) * (2 * jnp.pi / count)


def _best_rotation(raw: jax.Array, config: ExploreConfig) -> jax.Array:
    """The rotation theta* in [0, 2 pi / tau) of the largest sum of D_safe (lines 4 to 11), tried at the resolution of a
    column; where tau divides the width the directions are column centres."""
    tau = config.trajectories
    tries = math.ceil(raw.shape[0] / tau)  # 1 where there are more trajectories than columns
    rotations = (jnp.arange(tries) + 0.5) * (2 * jnp.pi / (tau * tries))
    safe = safe_distances(raw, _fan(rotations, tau).ravel(), config=config).reshape(tries, tau)
    return rotations[jnp.argmax(safe.sum(axis=1))]


def _radial_trajectories(panorama: Panorama, *, config: ExploreConfig = ExploreConfig()) -> Trajectories:
    """The tau paths { k step v | k step <= l }, v = (cos phi, -sin phi, 0), that see the most (Algorithm 1, whole),
    longest first.

    `panorama` (h, w) stands at the origin, not rotated; where its distance is in doubt, paths keep as far away as it
    may be wrong. Where the origin has no room the path is the origin alone.
    """
    nearest = panorama.distance if panorama.doubt is None else panorama.distance * jnp.maximum(1 - panorama.doubt, 0.0)
    raw = band_profile(nearest, panorama.valid, config=config)
    rotation = _best_rotation(raw, config)
    directions = _fan(rotation, config.trajectories)
    free = travel(safe_distances(raw, directions, config=config), config=config)
    # The longest reveals most, and what is guessed there is of one piece: it goes first (benchmarks/README.md).
    order = jnp.argsort(-free, stable=True)
    directions, lengths = directions[order], jnp.minimum(free[order], config.max_length)
    points = jnp.floor(lengths / config.step).astype(jnp.int32) + 1
    counts = jnp.minimum(points, config.max_frames)
    frames = jnp.minimum(jnp.arange(config.max_frames), counts[:, None] - 1)
    positions = (frames * config.step)[..., None] * horizontal_direction(directions)[:, None]
    axes = jnp.broadcast_to(world_from_camera_axes(), (*frames.shape, 3, 3))
    return Trajectories(
        positions=positions,
        world_from_camera=rigid(axes, positions),
        counts=counts,
        overflow=points - counts,
        directions=directions,
        lengths=lengths,
        rotation=rotation,
        raw=raw,
        safe=safe_distances(raw, azimuths(raw.shape[0]), config=config),
    )


radial_trajectories = jax.jit(_radial_trajectories, static_argnames=("config",))
