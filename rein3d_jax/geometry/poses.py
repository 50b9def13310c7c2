"""Rigid poses as 4x4 matrices, and the cameras that stand upright in the world."""

import jax
import jax.numpy as jnp
import numpy as np

from rein3d_jax.conventions import EQUIRECTANGULAR, PINHOLE
from rein3d_jax.geometry.pinhole import focal_from_fov
from rein3d_jax.scene import Camera


@jax.jit
def rigid(rotation: jax.Array, translation: jax.Array) -> jax.Array:
    """The pose (..., 4, 4) of a rotation (..., 3, 3) and a translation (..., 3)."""
    top = jnp.concatenate([rotation, translation[..., None]], axis=-1)
    bottom = jnp.broadcast_to(jnp.array([0.0, 0.0, 0.0, 1.0], top.dtype), (*top.shape[:-2], 1, 4))
    return jnp.concatenate([top, bottom], axis=-2)


def invert(pose: jax.Array) -> jax.Array:
    """The inverse a_from_b of b_from_a (..., 4, 4), which is rigid."""
    rotation = jnp.swapaxes(pose[..., :3, :3], -1, -2)
    moved = jnp.einsum("...ij,...j->...i", rotation, pose[..., :3, 3], precision=jax.lax.Precision.HIGHEST)
    return rigid(rotation, -moved)


@jax.jit
def upright(position: jax.Array, yaw: jax.Array = 0.0, pitch: jax.Array = 0.0) -> jax.Array:
    """The pose world_from_camera (4, 4) of an OpenCV camera at `position` (3,) that faces +X when yaw and pitch are 0;
    positive yaw is to the left, positive pitch up (radians)."""
    yaw, pitch = jnp.asarray(yaw, jnp.float32), jnp.asarray(pitch, jnp.float32)
    forward = jnp.stack([jnp.cos(yaw) * jnp.cos(pitch), jnp.sin(yaw) * jnp.cos(pitch), jnp.sin(pitch)])
    right = jnp.stack([jnp.sin(yaw), -jnp.cos(yaw), jnp.zeros_like(yaw)])
    down = jnp.cross(forward, right)
    return rigid(jnp.stack([right, down, forward], axis=-1), jnp.asarray(position, jnp.float32))


def equirectangular_camera(world_from_camera: jax.Array, height: int) -> Camera:
    """A full-sphere camera of `height` x 2 `height` pixels."""
    return Camera(
        world_from_camera, np.ones(2, np.float32), np.zeros(2, np.float32), EQUIRECTANGULAR, 2 * height, height
    )


def pinhole_camera(world_from_camera: jax.Array, size: int | tuple[int, int], fov: float) -> Camera:
    """A pinhole camera of `size` pixels, (h, w) or a side of a square, with its axis in the middle; `fov` across the
    width, in radians."""
    height, width = (size, size) if isinstance(size, int) else size
    focal = np.full(2, focal_from_fov(fov, width), np.float32)
    centre = np.array([width / 2, height / 2], np.float32)
    return Camera(world_from_camera, focal, centre, PINHOLE, width, height)
