"""What a window shows: a sky over a skyline of houses or trees, endlessly far away."""

import jax
import jax.numpy as jnp

from rein3d_jax.rooms.model import Outside
from rein3d_jax.rooms.tracing.pattern import fractal_noise
from rein3d_jax.rooms.tracing.vectors import Vector, components

_EDGE = 0.04  # of the tangent: the skyline's softness, about a pixel of a 64-row panorama


def outside(view: Outside, ray: Vector, pitch: float, seed: jax.Array) -> Vector:
    """Linear colours (display value 1 = middling) in the direction of `ray`, filtered for `pitch` radians a pixel."""
    azimuth = jnp.arctan2(ray[1], ray[0])
    height = ray[2] * jax.lax.rsqrt(ray[0] ** 2 + ray[1] ** 2 + 1e-6)
    x, y = azimuth * view.scale[0], height * view.scale[0] * view.scale[1]
    size = pitch * view.scale[0] * jnp.maximum(view.scale[1], 1.0)
    fine = fractal_noise(x, y, size, jnp.float32(0.7), seed)
    coarse = fractal_noise(x * 0.5, jnp.zeros_like(x), size, jnp.float32(0.5), seed + jnp.uint32(9))
    skyline = view.skyline[0] + view.skyline[1] * coarse
    sky = jnp.clip((height - skyline) / _EDGE + 0.5, 0, 1)
    ground = jnp.clip((-0.12 - height) / _EDGE + 0.5, 0, 1)
    zenith = jnp.clip(height * 1.2, 0, 1)
    rows = [components(row) for row in view.colours]
    return tuple(
        view.brightness * (_mix(_mix(c * (1 + 0.7 * fine), d, ground), _mix(b, a, zenith) * (1 + 0.12 * fine), sky))
        for a, b, c, d in zip(*rows, strict=True)
    )


def _mix(a, b, share):
    return a + (b - a) * share
