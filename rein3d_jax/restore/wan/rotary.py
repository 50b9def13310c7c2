"""Rotary position embedding over (time, height, width): a token's pairs of channels rotate by angles of its place.

A head's `head_dim` channels are shared out as height = width = 2 (head_dim // 6) and time the rest, in the order
time, height, width; neighbouring channels form a pair. An anchor frame takes t = 0, the video begins at t = 1.
"""

import jax
import jax.numpy as jnp
import numpy as np

_THETA = 1e4


def rotary_tables(grid: tuple[int, int, int], head_dim: int, *, circular: bool) -> tuple[jax.Array, jax.Array]:
    """Cosine and sine of each pair's angle, (t h w, head_dim / 2) float32, computed in float64.

    `circular` rounds each width frequency to whole revolutions around the panorama (the slowest to none), so that
    attention, which depends on differences of angles alone, cannot tell a rolled panorama from another.
    """
    side = 2 * (head_dim // 6)
    frequencies = [_frequencies(head_dim - 2 * side), _frequencies(side), _frequencies(side)]
    if circular:
        harmonic = 2 * np.pi / grid[2]
        frequencies[2] = np.round(frequencies[2] / harmonic) * harmonic
    angles = [np.outer(np.arange(count), frequency) for count, frequency in zip(grid, frequencies, strict=True)]
    return _over_grid([np.cos(angle) for angle in angles], grid), _over_grid([np.sin(angle) for angle in angles], grid)


def rotate_pairs(x: jax.Array, cosine: jax.Array, sine: jax.Array) -> jax.Array:
    """x (b, n, heads, d) with channels (2k, 2k + 1) rotated by the angles of `cosine`, `sine` (n, d / 2)."""
    even, odd = jnp.moveaxis(x.reshape(*x.shape[:-1], -1, 2).astype(jnp.promote_types(x.dtype, jnp.float32)), -1, 0)
    cosine, sine = cosine[:, None], sine[:, None]
    return jnp.stack([even * cosine - odd * sine, even * sine + odd * cosine], axis=-1).reshape(x.shape).astype(x.dtype)


def _frequencies(channels: int) -> np.ndarray:
    """_THETA^(-2k / channels), radians a step."""
    return _THETA ** (-np.arange(0, channels, 2) / channels)


def _over_grid(tables, grid):
    """Three small tables (count, pairs) from the host, spread over the tokens on the device: a program has no large
    constants."""
    t, h, w = (jnp.asarray(table, jnp.float32) for table in tables)
    parts = (t[:, None, None], h[None, :, None], w[None, None])
    spread = [jnp.broadcast_to(part, (*grid, part.shape[-1])) for part in parts]
    return jnp.concatenate(spread, axis=-1).reshape(grid[0] * grid[1] * grid[2], -1)
