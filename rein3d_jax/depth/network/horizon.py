"""The horizon branch: the room's walls and ceiling by column, from features squeezed over the rows.

A floor at height -1 (distances are in camera heights), a ceiling at +c and a wall at horizontal distance r per column
make the background's distance in closed form (after HoHoNet, Sun et al. 2021, which regresses columns too)."""

import flax.linen as nn
import jax
import jax.numpy as jnp
import numpy as np

from rein3d_jax.depth.network.config import DepthNetworkConfig
from rein3d_jax.geometry.sphere import latitudes

_FREQUENCIES = 8  # of the azimuth between two columns, by which attention tells where they stand to each other
_USUAL = 0.7  # inverse distance of walls and ceiling at first, per camera height
_FAR = 0.02  # least inverse distance, per camera height


def background_inverse(walls: jax.Array, ceiling: jax.Array, height: int) -> jax.Array:
    """Inverse distance (n, height, w) from inverse horizontal distances of walls (n, w) and inverse heights of the
    ceiling above the camera (n, w), all per camera height: the nearest of floor, walls and ceiling.

    1/d = max(-sin(latitude), cos(latitude) / r, sin(latitude) / c)"""
    latitude = latitudes(height)[:, None]
    wall = jnp.cos(latitude) * walls[:, None]
    return jnp.maximum(jnp.maximum(-jnp.sin(latitude), jnp.sin(latitude) * ceiling[:, None]), wall)


def bands_of(grid: jax.Array, bands: int) -> jax.Array:
    """Columns (n, w, bands c) of a grid (n, h, w, c): rows averaged over bands of latitude, or repeated."""
    n, h, w, c = grid.shape
    edges = np.clip((np.arange(bands + 1)[:, None] * h / bands - np.arange(h)), 0, 1)
    weights = np.diff(edges, axis=0)  # share of each row in each band
    weights = (weights / weights.sum(1, keepdims=True)).astype(np.float32)
    return jnp.einsum("bh,nhwc->nwbc", weights, grid).reshape(n, w, bands * c)


def to_columns(columns: jax.Array, count: int) -> jax.Array:
    """Columns (n, count, c) of (n, w, c), bilinear around the circle, count a multiple of w."""
    factor = count // columns.shape[1]
    assert factor * columns.shape[1] == count, (columns.shape, count)
    share = ((np.arange(factor) + 0.5) / factor - 0.5).astype(np.float32)[:, None]
    here, left, right = (columns[:, :, None], jnp.roll(columns, 1, 1)[:, :, None], jnp.roll(columns, -1, 1)[:, :, None])
    mixed = (1 - abs(share)) * here + np.maximum(-share, 0) * left + np.maximum(share, 0) * right
    return mixed.reshape(columns.shape[0], count, columns.shape[2])


class CircularAttention(nn.Module):
    """Attention among columns (n, w, c) with a bias that depends on the azimuth between them alone."""

    heads: int

    @nn.compact
    def __call__(self, columns: jax.Array) -> jax.Array:
        n, w, c = columns.shape
        query, key, value = jnp.moveaxis(nn.Dense(3 * c)(columns).reshape(n, w, 3, self.heads, -1), 2, 0)
        scores = jnp.einsum("nqhc,nkhc->nhqk", query, key) * query.shape[-1] ** -0.5
        waves = self.param("waves", nn.initializers.normal(0.3), (self.heads, 2 * _FREQUENCIES))
        weights = jax.nn.softmax(scores + _relative(waves, w), axis=-1)
        return nn.Dense(c)(jnp.einsum("nhqk,nkhc->nqhc", weights, value).reshape(n, w, c))


def _relative(waves: jax.Array, width: int) -> jax.Array:
    """Bias (heads, w, w): a Fourier series of the azimuth from one column to the other."""
    between = (np.arange(width)[None] - np.arange(width)[:, None]) * (2 * np.pi / width)
    phases = between[..., None] * np.arange(1, _FREQUENCIES + 1)
    series = np.concatenate([np.cos(phases), np.sin(phases)], axis=-1).astype(np.float32)
    return jnp.einsum("hf,qkf->hqk", waves, series)


class HorizonLayer(nn.Module):
    """Attention, then a convolution along the circle inside a perceptron; both added."""

    heads: int

    @nn.compact
    def __call__(self, columns: jax.Array) -> jax.Array:
        channels = columns.shape[-1]
        columns = columns + CircularAttention(self.heads)(nn.LayerNorm()(columns))
        hidden = nn.Dense(2 * channels)(nn.LayerNorm()(columns))
        kernel = self.param("kernel", nn.initializers.normal(0.4), (5, hidden.shape[-1]))
        hidden = sum(kernel[i] * jnp.roll(hidden, 2 - i, axis=1) for i in range(5))
        return columns + nn.Dense(channels)(nn.gelu(hidden))


class Horizon(nn.Module):
    """Features at strides 4, 8, 16, 32 -> columns (n, w / 4, c) and inverse walls and ceiling (n, w / 4, 2)."""

    config: DepthNetworkConfig

    @nn.compact
    def __call__(self, features: list[jax.Array]) -> tuple[jax.Array, jax.Array]:
        config, count = self.config, features[0].shape[2]
        columns = 0.0
        for halvings, grid in enumerate(features):
            small = nn.gelu(nn.Dense(min(grid.shape[-1], 64))(grid))
            squeezed = nn.Dense(config.horizon)(bands_of(small, config.bands >> min(halvings, 2)))
            columns = columns + to_columns(squeezed, count)
        for _ in range(config.layers):
            columns = HorizonLayer(config.heads)(columns)
        columns = nn.LayerNorm()(columns)
        raw = nn.Dense(2, kernel_init=nn.initializers.normal(0.01))(columns)
        return columns, _FAR + jnp.exp(raw) * _USUAL
