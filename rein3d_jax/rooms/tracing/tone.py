"""Linear light to display values."""

import jax
import jax.numpy as jnp

from rein3d_jax.rooms.tracing.vectors import Vector


def display(light: Vector, exposure: jax.Array, gamma: jax.Array) -> Vector:
    """Linear light -> sRGB in [0, 1]: 1 - exp(-exposure light), which never clips, raised to `gamma` (contrast), then
    the sRGB transfer (IEC 61966-2-1)."""
    return tuple(_srgb((1 - jnp.exp(-exposure * jnp.maximum(x, 0))) ** gamma) for x in light)


def _srgb(linear: jax.Array) -> jax.Array:
    bent = 1.055 * jnp.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055
    return jnp.where(linear <= 0.0031308, 12.92 * linear, bent)
