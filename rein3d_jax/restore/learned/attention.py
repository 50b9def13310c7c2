"""Attention over the cells of a panorama's grid, periodic in azimuth. Plain functions."""

import jax
import jax.numpy as jnp
import numpy as np

_BASE = 100.0  # longest wavelength of the rows' angles, in rows over 2 pi


def rotary_angles(rows: int, columns: int, size: int) -> jax.Array:
    """Angles (rows * columns, size / 2) in radians by which a cell's pairs of channels are rotated.

    The first half of the pairs rotates with the column, by whole revolutions over the full circle, so that only the
    difference of two azimuths counts and the seam is no border; the others with the row, as rotary embeddings do
    (Su et al. 2021).
    """
    pairs = size // 4
    harmonics = np.arange(pairs) % (columns // 2) + 1
    azimuth = np.arange(columns)[:, None] * harmonics * (2 * np.pi / columns)
    height = np.arange(rows)[:, None] * _BASE ** (-np.arange(pairs) / pairs)
    both = np.broadcast_arrays(azimuth[None], height[:, None])
    return jnp.asarray(np.concatenate(both, axis=-1).reshape(rows * columns, 2 * pairs), jnp.float32)


def rotate_halves(heads: jax.Array, angles: jax.Array) -> jax.Array:
    """Heads (..., n, heads, size), each pair (i, i + size / 2) of channels rotated by angles (n, size / 2)."""
    cosine, sine = jnp.cos(angles)[:, None].astype(heads.dtype), jnp.sin(angles)[:, None].astype(heads.dtype)
    first, second = jnp.split(heads, 2, axis=-1)
    return jnp.concatenate([first * cosine - second * sine, first * sine + second * cosine], axis=-1)


def dot_product_attention(query: jax.Array, key: jax.Array, value: jax.Array) -> jax.Array:
    """Attention of queries (..., n, heads, size) to keys and values (..., m, heads, size); the softmax in float32."""
    scores = jnp.einsum("...nhd,...mhd->...hnm", query, key) * query.shape[-1] ** -0.5
    shares = jax.nn.softmax(scores.astype(jnp.float32), axis=-1).astype(value.dtype)
    return jnp.einsum("...hnm,...mhd->...nhd", shares, value)
