"""Latitude-aware noise (paper, Sec. 4.2 (1)): near the poles, where pixels crowd, noise is correlated along a row.

The paper warps columns by x' = x_c + (x - x_c) cos(latitude) and does not say how it interpolates. Read bilinearly
("paper"), variance falls to 0.68 and the seam tears: at 56 x 112, neighbours' correlation is 0.37 and across the seam
0.00. "latitude" has the idea and the law of noise both: a row draws round(w cos(latitude)) samples on a CIRCLE and
mixes neighbours with weights of unit L2 norm, so that each latent is exactly N(0, 1) and no column is special.
"""

import jax
import jax.numpy as jnp
import numpy as np

from rein3d_jax.errors import InputError


def draw_noise(key: jax.Array, shape: tuple[int, ...], *, kind: str = "latitude") -> jax.Array:
    """Noise (..., h, w, c) float32 at latent resolution; rows are latitudes. Raises InputError for an unknown kind."""
    if kind not in NOISES:
        raise InputError(f'noise "{kind}" is unknown; choose one of {", ".join(NOISES)}')
    return NOISES[kind](key, shape)


def white_noise(key: jax.Array, shape: tuple[int, ...]) -> jax.Array:
    """Independent N(0, 1) everywhere."""
    return jax.random.normal(key, shape)


def latitude_noise(key: jax.Array, shape: tuple[int, ...]) -> jax.Array:
    """N(0, 1), correlated over w / round(w cos(latitude)) columns, alike all around.

    A row of as many samples as columns stays white; any other is shifted by a random phase, or the columns that fall
    on samples would give away the seam.
    """
    height, width = shape[-3:-1]
    counts = np.maximum(np.round(width * _row_cosines(height)), 2).astype(int)[:, None, None]
    key_phase, key_white = jax.random.split(key)
    phase = jax.random.uniform(key_phase, (*shape[:-2], 1, shape[-1])) * counts * (counts < width)
    place = jnp.arange(width)[:, None] * (counts / width) + phase
    near = jnp.floor(place)
    share = place - near
    white = white_noise(key_white, shape)
    left, right = (_along_rows(white, (near.astype(int) + offset) % counts) for offset in (0, 1))
    return (left * (1 - share) + right * share) / jnp.hypot(1 - share, share)


def paper_noise(key: jax.Array, shape: tuple[int, ...]) -> jax.Array:
    """The paper's warp to the letter, read bilinearly: neither of unit variance nor continuous at the seam."""
    height, width = shape[-3:-1]
    centre = (width - 1) / 2
    place = (centre + (np.arange(width) - centre) * _row_cosines(height)[:, None])[..., None]
    near = np.clip(np.floor(place).astype(int), 0, width - 2)
    share = place - near
    white = white_noise(key, shape)
    return _along_rows(white, near) * (1 - share) + _along_rows(white, near + 1) * share


NOISES = {"latitude": latitude_noise, "white": white_noise, "paper": paper_noise}  # the kinds, by name


def _row_cosines(height):
    return np.cos((0.5 - (np.arange(height) + 0.5) / height) * np.pi)


def _along_rows(image, columns):
    """image (..., h, w, c) at columns (..., h, w, c) of each row; leading axes and c may be absent or 1."""
    return jnp.take_along_axis(image, jnp.broadcast_to(columns, image.shape), axis=-2)
