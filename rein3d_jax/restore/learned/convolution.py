"""Convolutions on equirectangular grids: columns wrap, the row at a pole repeats. Grids are (n, h, w, c)."""

import flax.linen as nn
import jax
import jax.numpy as jnp


def wrap(grid: jax.Array) -> jax.Array:
    """Grid (n, h + 2, w + 2, c) of (n, h, w, c), padded by the neighbours on the sphere."""
    wide = jnp.concatenate([grid[:, :, -1:], grid, grid[:, :, :1]], axis=2)
    return jnp.concatenate([wide[:, :1], wide, wide[:, -1:]], axis=1)


def fold(grid: jax.Array, size: int) -> jax.Array:
    """Grid (n, h / size, w / size, size^2 c) of (n, h, w, c): the pixels of a block become channels."""
    n, h, w, c = grid.shape
    blocks = grid.reshape(n, h // size, size, w // size, size, c)
    return jnp.moveaxis(blocks, 2, 3).reshape(n, h // size, w // size, size * size * c)


def unfold(grid: jax.Array, size: int) -> jax.Array:
    """The inverse of `fold`."""
    n, h, w, c = grid.shape
    blocks = grid.reshape(n, h, w, size, size, c // size**2)
    return jnp.moveaxis(blocks, 3, 2).reshape(n, h * size, w * size, c // size**2)


class Conv(nn.Module):
    """3 x 3 convolution, seam-exact."""

    features: int
    init: nn.initializers.Initializer = nn.initializers.lecun_normal()

    @nn.compact
    def __call__(self, grid: jax.Array) -> jax.Array:
        return nn.Conv(self.features, (3, 3), padding="VALID", kernel_init=self.init)(wrap(grid))


class ConvBlock(nn.Module):
    """x + conv(gelu(conv(norm(x)))), the last convolution zero at first."""

    @nn.compact
    def __call__(self, grid: jax.Array) -> jax.Array:
        hidden = Conv(grid.shape[-1])(nn.LayerNorm()(grid))
        return grid + Conv(grid.shape[-1], nn.initializers.zeros)(nn.gelu(hidden))
