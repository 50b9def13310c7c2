"""What super-resolution may not change: the pixels that were measured."""

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.pyramid import blocks, halve

_AGREES = 0.03  # sRGB by which what was seen from elsewhere may differ: reflections, and edges a pixel off


@jax.jit
def as_measured(fine: jax.Array, measured: jax.Array) -> jax.Array:
    """The picture `fine` (2 h, 2 w, 3) with the detail that it has within each 2 x 2 pixels, and `measured` (h, w, 3),
    in [0, 1], as their mean: the detail is weakened where the sum would leave [0, 1]."""
    of_block = blocks(fine)
    mean = measured[:, :, None]
    detail = of_block - of_block.mean(axis=2, keepdims=True)
    room = jnp.where(detail > 0, 1 - mean, mean) / jnp.maximum(jnp.abs(detail), 1e-9)
    inside = mean + detail * jnp.minimum(room.min(axis=2, keepdims=True), 1.0)
    height, width, channels = measured.shape
    split = inside.reshape(height, width, 2, 2, channels)
    return jnp.moveaxis(split, 2, 1).reshape(2 * height, 2 * width, channels)


@jax.jit
def borne_out(fine: jax.Array, measured: jax.Array) -> jax.Array:
    """How far (2 h, 2 w), in [0, 1], the mean of each 2 x 2 pixels of `fine` (2 h, 2 w, 3) is what was `measured`
    (h, w, 3)."""
    off = halve(fine) - measured
    share = jnp.exp(-jnp.sum(off**2, axis=-1) / (2 * _AGREES**2))
    return jnp.repeat(jnp.repeat(share, 2, axis=0), 2, axis=1)
