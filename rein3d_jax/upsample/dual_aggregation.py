"""The Dual Aggregation Transformer for super-resolution by 2 (Chen et al. 2023, DAT-light), seamless round the
azimuth.

Blocks come in pairs: attention between pixels in windows, flat ones for one half of the channels and tall ones for the
other, every second time shifted by half a window; then attention between channels over the whole picture. Each is
joined by what a convolution says (equations 6 to 9). Batch norms are folded into the convolutions before them, and the
network of relative positions into the table that it gives.
"""

from functools import partial

import flax.linen as nn
import jax
import jax.numpy as jnp
import numpy as np

from rein3d_jax.geometry.resample import pad_sphere
from rein3d_jax.upsample.window_attention import Window, window_attention

_STEP = 32  # a picture's rows, and half its columns, are a multiple of this: the longer side of a window
_MEAN = np.array([0.4488, 0.4371, 0.4040], np.float32)  # of the pictures that it was trained on
_EPSILON = 1e-5  # of its layer norms
_OVER_POLES = 16  # rows that the network sees beyond each pole

# Sizes of DAT-light
_WIDTH, _HEADS, _PAIRS, _EXPAND = 60, 6, 9, 2
_WINDOW = (8, 32)  # rows and columns of a flat one


@jax.jit
def twice_as_fine(parameters: dict, rgb: jax.Array) -> jax.Array:
    """sRGB (2 h, 4 h, 3) of an equirectangular picture (h, 2 h, 3), h a multiple of 32: its detail guessed by the
    network's `parameters`. Values may leave [0, 1]. Rolled by a multiple of 32 columns, the result rolls along."""
    height = len(rgb)
    assert rgb.shape == (height, 2 * height, 3) and height % _STEP == 0, rgb.shape
    tall = pad_sphere(rgb, _OVER_POLES)[:, _OVER_POLES:-_OVER_POLES]
    fine = DualAggregation().apply({"params": parameters}, tall)
    return fine[2 * _OVER_POLES : -2 * _OVER_POLES]


def initial_upsampler(key: jax.Array) -> dict:
    """Parameters of an untrained network."""
    return DualAggregation().init(key, jnp.zeros((_STEP, _STEP, 3)))["params"]


class DualAggregation(nn.Module):
    """(h, w, 3) -> (2 h, 2 w, 3), both sides multiples of the window's. Columns wrap; beyond the rows are zeros."""

    @nn.compact
    def __call__(self, rgb: jax.Array) -> jax.Array:
        shallow = _Convolution(_WIDTH, name="first")(rgb - _MEAN)
        start = _norm("before")(shallow)
        pairs = nn.scan(_Pair, variable_axes={"params": 0}, split_rngs={"params": True}, length=_PAIRS)
        deep, _ = pairs(name="pairs")(start, jnp.arange(_PAIRS) % 2 == 1)
        deep = _norm("after")(start + _Narrow(name="group")(deep))
        fine = _Convolution(12, name="last")(shallow + _Narrow(name="body")(deep))
        height, width = rgb.shape[:2]
        shuffled = fine.reshape(height, width, 3, 2, 2).transpose(0, 3, 1, 4, 2)  # as torch's PixelShuffle
        return shuffled.reshape(2 * height, 2 * width, 3) + _MEAN


class _Pair(nn.Module):
    """A block that attends in windows, shifted or not, and one that attends between channels."""

    @nn.compact
    def __call__(self, grid: jax.Array, shifted: jax.Array) -> tuple[jax.Array, None]:
        grid += _InWindows(name="windows")(_norm("windows_norm")(grid), shifted)
        grid += _Gated(name="windows_hidden")(_norm("windows_hidden_norm")(grid))
        grid += _BetweenChannels(name="channels")(_norm("channels_norm")(grid))
        grid += _Gated(name="channels_hidden")(_norm("channels_hidden_norm")(grid))
        return grid, None


class _InWindows(nn.Module):
    """Attention between the pixels of a window, beside a convolution of the values."""

    @nn.compact
    def __call__(self, grid: jax.Array, shifted: jax.Array) -> jax.Array:
        half = _WIDTH // 2
        joint = nn.Dense(3 * _WIDTH, name="qkv")(grid)
        parts = joint.reshape(*grid.shape[:2], 3, _WIDTH)
        attended = []
        for number, (rows, columns) in enumerate((_WINDOW, _WINDOW[::-1])):
            size = (_HEADS // 2, 2 * rows - 1, 2 * columns - 1)
            near = self.param(f"near{number}", nn.initializers.zeros, size)
            window = Window(rows, columns, _HEADS // 2)
            attended.append(window_attention(parts[..., number * half :][..., :half], near, shifted, window))
        attended = jnp.concatenate(attended, axis=-1)
        local = _gelu(_Depthwise(name="local")(parts[:, :, 2]))
        return nn.Dense(_WIDTH, name="out")(_joined(attended, local, self))


class _BetweenChannels(nn.Module):
    """Attention between the channels of a head, over all pixels, beside a convolution of the values."""

    @nn.compact
    def __call__(self, grid: jax.Array) -> jax.Array:
        warmth = self.param("warmth", nn.initializers.ones, (_HEADS,))
        joint = nn.Dense(3 * _WIDTH, name="qkv")(grid)
        query, key, value = jnp.split(joint.reshape(-1, 3 * _WIDTH), 3, axis=-1)
        # All channels with all, of which each head keeps its own: one large product is faster than six small ones.
        length = _length_over_pixels(query)[:, None] * _length_over_pixels(key)
        alike = jnp.matmul(query.T, key) / length * jnp.repeat(warmth, _WIDTH // _HEADS)[:, None]
        head = jnp.arange(_WIDTH) // (_WIDTH // _HEADS)
        share = jax.nn.softmax(alike, axis=-1, where=head[:, None] == head)
        attended = jnp.matmul(value, share.T).reshape(grid.shape)
        local = _gelu(_Depthwise(name="local")(value.reshape(grid.shape)))
        return nn.Dense(_WIDTH, name="out")(_joined(local, attended, self))


class _Gated(nn.Module):
    """Hidden layer of which one half, convolved, gates the other (equation 10)."""

    @nn.compact
    def __call__(self, grid: jax.Array) -> jax.Array:
        hidden = _gelu(nn.Dense(_EXPAND * _WIDTH, name="wide")(grid))
        kept, gate = jnp.split(hidden, 2, axis=-1)
        return nn.Dense(_WIDTH, name="narrow")(kept * _Depthwise(name="gate")(_norm("gate_norm")(gate)))


class _Narrow(nn.Module):
    """Three convolutions, the middle one a quarter as wide."""

    @nn.compact
    def __call__(self, grid: jax.Array) -> jax.Array:
        width = grid.shape[-1]
        hidden = nn.leaky_relu(_Convolution(width // 4, name="first")(grid), 0.2)
        hidden = nn.leaky_relu(nn.Dense(width // 4, name="middle")(hidden), 0.2)
        return _Convolution(width, name="last")(hidden)


class _Convolution(nn.Module):
    """3 x 3, with a bias."""

    features: int

    @nn.compact
    def __call__(self, grid: jax.Array) -> jax.Array:
        return nn.Conv(self.features, (3, 3), padding="VALID", name="conv")(_rim(grid))


class _Depthwise(nn.Module):
    """3 x 3 for each channel apart, with a bias; shifted products, since XLA's grouped convolution is slow on a CPU."""

    @nn.compact
    def __call__(self, grid: jax.Array) -> jax.Array:
        height, width, channels = grid.shape
        kernel = self.param("kernel", nn.initializers.normal(1 / 3), (3, 3, channels))
        bias = self.param("bias", nn.initializers.zeros, (channels,))
        padded = _rim(grid)
        return bias + sum(kernel[i, j] * padded[i : i + height, j : j + width] for i in range(3) for j in range(3))


def _rim(grid: jax.Array) -> jax.Array:
    wide = jnp.concatenate([grid[:, -1:], grid, grid[:, :1]], axis=1)
    return jnp.pad(wide, ((1, 1), (0, 0), (0, 0)))


def _norm(name: str) -> nn.LayerNorm:
    return nn.LayerNorm(epsilon=_EPSILON, name=name)


_gelu = partial(nn.gelu, approximate=False)


def _length_over_pixels(part: jax.Array) -> jax.Array:
    """(c,) of each channel (n, c)."""
    return jnp.maximum(jnp.sqrt(jnp.sum(part**2, axis=0)), 1e-12)


def _joined(of_pixels: jax.Array, of_channels: jax.Array, module: nn.Module) -> jax.Array:
    """What looked at pixels, gated channel by channel by the other, and the other, gated pixel by pixel by it."""
    by_channel = _gate_of_channels(of_channels, module)
    return of_pixels * by_channel + of_channels * _gate_of_pixels(of_pixels, module)


def _gate_of_channels(grid: jax.Array, module: nn.Module) -> jax.Array:
    """Of each channel, in [0, 1], from its mean over the picture."""
    width = grid.shape[-1]
    hidden = _gelu(nn.Dense(width // 8, parent=module, name="of_channels_in")(grid.mean((0, 1))))
    return nn.sigmoid(nn.Dense(width, parent=module, name="of_channels_out")(hidden))


def _gate_of_pixels(grid: jax.Array, module: nn.Module) -> jax.Array:
    """Of each pixel, in [0, 1], from its channels."""
    hidden = _gelu(nn.Dense(grid.shape[-1] // 16, parent=module, name="of_pixels_in")(grid))
    return nn.sigmoid(nn.Dense(1, parent=module, name="of_pixels_out")(hidden))
