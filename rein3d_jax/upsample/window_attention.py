"""Attention between the pixels of a window, a few windows at a time: what they compare stays in a core's cache."""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

_APART = -100.0  # added between pixels that are no neighbours
_TOGETHER = 8  # windows: 6 MB of comparisons; a whole row of tall ones took 1.7 times as long


class Window(NamedTuple):
    """Its size, and the heads that attend in it."""

    rows: int
    columns: int
    heads: int


def window_attention(parts: jax.Array, near: jax.Array, shifted: jax.Array, window: Window) -> jax.Array:
    """Attended values (h, w, c) of queries, keys and values (h, w, 3, c), in windows that tile the picture or, where
    `shifted` () bool, lie half a window down and to the right of those. `near` (heads, 2 rows - 1, 2 columns - 1) is
    added by how far a key lies before the query. Windows reach round from the last column to the first; from the last
    row to the first they do not."""
    height, width, _, channels = parts.shape
    rows, columns, heads = window
    assert height % rows == 0 and width % columns == 0 and channels % heads == 0, (parts.shape, window)
    by = jnp.where(shifted, jnp.array([rows // 2, columns // 2]), 0)
    down, along = height // rows, width // columns
    together = math.gcd(down * along, _TOGETHER)
    tiles = jnp.roll(parts, -by, axis=(0, 1)).reshape(down, rows, along, columns, 3, heads, -1)
    tiles = tiles.transpose(0, 2, 4, 5, 1, 3, 6).reshape(-1, together, 3, heads, rows * columns, channels // heads)
    bias = near.reshape(heads, -1)[:, _offsets(rows, columns)]
    last = (shifted & (jnp.arange(down * along) // along == down - 1)).reshape(-1, together, 1, 1, 1)

    def some_windows(at):
        tile, is_last = at
        query, key, value = jnp.moveaxis(tile, 1, 0)
        alike = jnp.einsum("whnc,whmc->whnm", query * query.shape[-1] ** -0.5, key) + bias
        alike += jnp.where(is_last, _across_the_end(rows, columns), 0.0)
        weight = jnp.exp(alike - alike.max(axis=-1, keepdims=True))
        # The weights' sum as one more value: a softmax divides ten times as many numbers.
        value = jnp.concatenate([value, jnp.ones_like(value[..., :1])], axis=-1)
        total = jnp.einsum("whnm,whmc->whnc", weight, value)
        return total[..., :-1] / total[..., -1:]

    found = jax.lax.map(some_windows, (tiles, last))
    found = found.reshape(down, along, heads, rows, columns, -1).transpose(0, 3, 1, 4, 2, 5)
    return jnp.roll(found.reshape(height, width, channels), by, axis=(0, 1))


def _places(rows: int, columns: int) -> np.ndarray:
    """(rows * columns, 2) row and column of each pixel of a window."""
    return np.stack(np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij"), axis=-1).reshape(-1, 2)


def _offsets(rows: int, columns: int) -> np.ndarray:
    """(n, n) where in the flattened table of relative places each pair of pixels stands."""
    places = _places(rows, columns)
    apart = places[:, None] - places[None] + [rows - 1, columns - 1]
    return apart[..., 0] * (2 * columns - 1) + apart[..., 1]


def _across_the_end(rows: int, columns: int) -> np.ndarray:
    """(n, n) added in the last row of shifted windows, whose lower halves are the picture's first rows."""
    wrapped = _places(rows, columns)[:, 0] >= rows - rows // 2
    return np.where(wrapped[:, None] != wrapped[None], np.float32(_APART), np.float32(0))
