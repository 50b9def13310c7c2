"""The sRGB transfer (IEC 61966-2-1) and its inverse, by channel, for JAX and NumPy arrays alike."""

import jax
import numpy as np

from rein3d_jax.geometry.array_namespace import array_namespace

_LINEAR_BEND, _SRGB_BEND = 0.0031308, 0.04045  # below these the curve is a line


def srgb_from_linear(linear: jax.Array | np.ndarray) -> jax.Array | np.ndarray:
    """sRGB in [0, 1] of linear light in [0, 1]."""
    xp = array_namespace(linear)
    bent = 1.055 * xp.maximum(linear, _LINEAR_BEND) ** (1 / 2.4) - 0.055
    return xp.where(linear <= _LINEAR_BEND, 12.92 * linear, bent)


def linear_from_srgb(srgb: jax.Array | np.ndarray) -> jax.Array | np.ndarray:
    """Linear light in [0, 1] of sRGB in [0, 1]."""
    xp = array_namespace(srgb)
    return xp.where(srgb <= _SRGB_BEND, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
