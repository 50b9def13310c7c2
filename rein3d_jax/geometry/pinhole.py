"""The pinhole map in OpenCV axes; pixels are continuous with the first centre at 0.5."""

import math

import jax
import jax.numpy as jnp


def focal_from_fov(fov: float, size: int) -> float:
    """The focal length in pixels of a field of view in radians across `size` pixels."""
    return size / (2 * math.tan(fov / 2))


def pinhole_rays(height: int, width: int, focal: jax.Array, centre: jax.Array) -> jax.Array:
    """Rays (height, width, 3) in camera axes with z = 1: a point is ray * depth along z."""
    u, v = jnp.meshgrid(jnp.arange(width) + 0.5, jnp.arange(height) + 0.5)
    x, y = (u - centre[0]) / focal[0], (v - centre[1]) / focal[1]
    return jnp.stack([x, y, jnp.ones_like(x)], axis=-1)


def pixels_from_points(points: jax.Array, focal: jax.Array, centre: jax.Array) -> tuple[jax.Array, jax.Array]:
    """The pixels (u, v) of camera-frame points (..., 3) with z > 0."""
    x, y, z = jnp.moveaxis(points, -1, 0)
    return focal[0] * x / z + centre[0], focal[1] * y / z + centre[1]
