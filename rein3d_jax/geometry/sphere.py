"""Equirectangular maps. `u` runs right, `v` down, both continuous with the first pixel's centre at 0.5;
a `ray` is a unit vector in the world frame (or, for `*_camera_*`, in OpenCV camera axes)."""

import jax
import jax.numpy as jnp
import numpy as np

# World from camera axes of an equirectangular camera that is not rotated: OpenCV +z is +X, +x is -Y, +y is -Z.
WORLD_FROM_CAMERA_AXES = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


def azimuths(width: int) -> jax.Array:
    """Azimuths (width,) of the column centres, radians to the right from +X."""
    return ((jnp.arange(width) + 0.5) / width - 0.5) * 2 * jnp.pi


def latitudes(height: int) -> jax.Array:
    """Latitudes (height,) of the row centres, radians, pi/2 at the top."""
    return (0.5 - (jnp.arange(height) + 0.5) / height) * jnp.pi


def horizontal_direction(azimuth: jax.Array) -> jax.Array:
    """The level direction v = (cos phi, -sin phi, 0): (...) -> (..., 3) (paper, Algorithm 1 line 16)."""
    return jnp.stack([jnp.cos(azimuth), -jnp.sin(azimuth), jnp.zeros_like(azimuth)], axis=-1)


def pixel_rays(height: int, width: int) -> jax.Array:
    """Unit rays (height, width, 3) through the pixel centres."""
    latitude = latitudes(height)[:, None, None]
    flat = horizontal_direction(azimuths(width))[None]
    up = jnp.array([0.0, 0.0, 1.0])
    return jnp.cos(latitude) * flat + jnp.sin(latitude) * up


def pixels_from_rays(rays: jax.Array, height: int, width: int) -> tuple[jax.Array, jax.Array]:
    """The pixels (u, v), u in [0, width], of world directions (..., 3) of any length."""
    azimuth = jnp.arctan2(-rays[..., 1], rays[..., 0])
    latitude = jnp.arctan2(rays[..., 2], jnp.hypot(rays[..., 0], rays[..., 1]))
    return (azimuth / (2 * jnp.pi) + 0.5) * width, (0.5 - latitude / jnp.pi) * height


def holding_pixels(u: jax.Array, v: jax.Array, height: int, width: int) -> tuple[jax.Array, jax.Array]:
    """(row, column) int of the pixels that hold the places u in [0, width], v in [0, height]."""
    row, column = jnp.floor(v).astype(jnp.int32), jnp.floor(u).astype(jnp.int32)
    return jnp.clip(row, 0, height - 1), jnp.clip(column, 0, width - 1)


def world_from_camera_axes() -> jax.Array:
    """The constant WORLD_FROM_CAMERA_AXES (3, 3) as a JAX array, float32."""
    return jnp.asarray(WORLD_FROM_CAMERA_AXES, jnp.float32)


def world_from_panorama(world_from_camera: jax.Array) -> jax.Array:
    """The rotation (3, 3) to the world from the axes of `pixel_rays`, of an equirectangular camera at (4, 4)."""
    return jnp.matmul(world_from_camera[:3, :3], world_from_camera_axes().T, precision=jax.lax.Precision.HIGHEST)


def rays_of_pose(world_from_camera: jax.Array, height: int, width: int) -> jax.Array:
    """Unit rays (height, width, 3), in the world, of an equirectangular camera at `world_from_camera` (4, 4)."""
    rotation = world_from_panorama(world_from_camera)
    return jnp.matmul(pixel_rays(height, width), rotation.T, precision=jax.lax.Precision.HIGHEST)


def pixel_rays64(height: int) -> np.ndarray:
    """`pixel_rays` (height, 2 height, 3) in NumPy's float64."""
    azimuth = ((np.arange(2 * height) + 0.5) / (2 * height) - 0.5) * 2 * np.pi
    latitude = ((0.5 - (np.arange(height) + 0.5) / height) * np.pi)[:, None]
    flat = np.cos(latitude)
    up = np.broadcast_to(np.sin(latitude), (height, 2 * height))
    return np.stack([flat * np.cos(azimuth), -flat * np.sin(azimuth), up], axis=-1)


def rays_of_pose64(world_from_camera: np.ndarray, height: int) -> np.ndarray:
    """The rays (height, 2 height, 3) of `rays_of_pose` in NumPy's float64, as exact distances need them."""
    return pixel_rays64(height) @ (np.asarray(world_from_camera, np.float64)[:3, :3] @ WORLD_FROM_CAMERA_AXES.T).T


def pixel_solid_angles(height: int, width: int) -> jax.Array:
    """The solid angle (height, width) of each pixel in steradians, exact; they sum to 4 pi."""
    edges = (0.5 - jnp.arange(height + 1) / height) * jnp.pi
    bands = jnp.sin(edges[:-1]) - jnp.sin(edges[1:])
    return jnp.broadcast_to((bands * 2 * jnp.pi / width)[:, None], (height, width))
