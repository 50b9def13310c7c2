"""The network: a U of convolutions around a transformer over the clip's tokens. Linen; params are a plain dict.

No column is special in it: rolling the clip by a multiple of TOKEN pixels rolls the result. Time enters
through each frame's place in the room alone (a feature), so clips of any length and spacing go through.
"""

import flax.linen as nn
import jax
import jax.numpy as jnp

from rein3d_jax.restore.learned.attention import dot_product_attention, rotary_angles, rotate_halves
from rein3d_jax.restore.learned.condition import FEATURES
from rein3d_jax.restore.learned.config import PATCH, TOKEN, NetworkConfig
from rein3d_jax.restore.learned.convolution import Conv, ConvBlock, fold, unfold
from rein3d_jax.restore.learned.mixture import CHANNELS


def initial_parameters(key: jax.Array, config: NetworkConfig) -> dict:
    """Parameters of a network that gives the fills' mean."""
    blank = jnp.zeros((1, 1, TOKEN, 2 * TOKEN, FEATURES))
    return jax.jit(Network(config).init)(key, blank, jnp.ones(1))["params"]


class TransformerBlock(nn.Module):
    """Block of the transformer: attention within a frame and to the anchor; across frames, cell by cell; a hidden
    layer.

    adaLN (Peebles & Xie 2023) from the noise level: shift, scale and gate of each of the three parts; gates 0 at first.
    """

    config: NetworkConfig

    @nn.compact
    def __call__(self, tokens: jax.Array, level: jax.Array, angles: jax.Array) -> tuple[jax.Array, None]:
        """Tokens (b, t, n, width) of tokens and noise level (b, width), and None, as nn.scan wants it."""
        parts = nn.Dense(9 * self.config.width, kernel_init=nn.initializers.zeros, bias_init=_gates_open)(level)
        shifts = jnp.split(parts[:, None, None], 9, axis=-1)
        for index, part in enumerate((self._space, self._time, self._hidden)):
            shift, scale, gate = shifts[3 * index : 3 * index + 3]
            normal = nn.LayerNorm(use_bias=False, use_scale=False)(tokens)
            tokens = tokens + gate * part(normal * (1 + scale) + shift, angles)
        return tokens, None

    def _heads(self, tokens: jax.Array, name: str) -> list[jax.Array]:
        joint = nn.Dense(3 * self.config.width, name=name)(tokens)
        split = joint.reshape(*tokens.shape[:-1], 3, self.config.heads, -1)
        query, key = (nn.RMSNorm(name=f"{name}_{part}")(split[..., i, :, :]) for i, part in enumerate(("q", "k")))
        return [query, key, split[..., 2, :, :]]

    def _space(self, tokens: jax.Array, angles: jax.Array) -> jax.Array:
        query, key, value = self._heads(tokens, "space")
        query, key = rotate_halves(query, angles), rotate_halves(key, angles)
        if self.config.anchor:
            # A key of the anchor is rotated like the cell it lies in: a frame attends to what lay in that direction.
            key, value = (jnp.concatenate([x, jnp.broadcast_to(x[:, :1], x.shape)], axis=2) for x in (key, value))
        found = dot_product_attention(query, key, value).reshape(tokens.shape)
        return nn.Dense(self.config.width, name="space_out")(found)

    def _time(self, tokens: jax.Array, angles: jax.Array) -> jax.Array:
        query, key, value = (jnp.swapaxes(x, 1, 2) for x in self._heads(tokens, "time"))
        first = 0 if self.config.anchor else 1
        found = jnp.swapaxes(dot_product_attention(query, key[:, :, first:], value[:, :, first:]), 1, 2)
        return nn.Dense(self.config.width, name="time_out")(found.reshape(tokens.shape))

    def _hidden(self, tokens: jax.Array, angles: jax.Array) -> jax.Array:
        hidden = nn.gelu(nn.Dense(self.config.expand * self.config.width, name="widen")(tokens))
        return nn.Dense(self.config.width, name="narrow")(hidden)


def _gates_open(key: jax.Array, shape: tuple[int, ...], dtype=jnp.float32) -> jax.Array:
    """A bias that is 1 for the gates: the zero-initialised head already makes the network start at the fills' mean."""
    return jnp.tile(jnp.repeat(jnp.array([0.0, 0.0, 1.0], dtype), shape[0] // 9), 3)


class Network(nn.Module):
    """The U: features of a clip -> how its fills are mixed and corrected (mixture.py)."""

    config: NetworkConfig

    @nn.compact
    def __call__(self, features: jax.Array, level: jax.Array) -> jax.Array:
        """Channels (b, t, h, w, CHANNELS) of features (b, t, h, w, c), h and w multiples of TOKEN, at noise level (b,)
        in [0, 1]. Frame 0 is the anchor."""
        config, (b, t, h, w, c) = self.config, features.shape
        assert h % TOKEN == 0 and w % TOKEN == 0, (h, w)
        fine = nn.Dense(config.fine)(fold(features.reshape(b * t, h, w, c), PATCH))
        fine = _convolved(fine, config.fine_blocks)
        tokens = nn.Dense(config.width)(fold(fine, TOKEN // PATCH))
        tokens = self._trunk(tokens.reshape(b, t, -1, config.width), level, h // TOKEN, w // TOKEN)
        tokens = nn.LayerNorm()(tokens).reshape(b * t, h // TOKEN, w // TOKEN, config.width)
        fine = fine + unfold(nn.Dense((TOKEN // PATCH) ** 2 * config.fine)(tokens), TOKEN // PATCH)
        fine = _convolved(fine, config.fine_blocks)
        out = Conv(PATCH**2 * CHANNELS, nn.initializers.zeros)(nn.LayerNorm()(fine))
        return unfold(out, PATCH).reshape(b, t, h, w, CHANNELS)

    def _trunk(self, tokens: jax.Array, level: jax.Array, rows: int, columns: int) -> jax.Array:
        angles = rotary_angles(rows, columns, self.config.width // self.config.heads)
        waves = level[:, None] * jnp.pi * (2.0 ** jnp.arange(-1, 5)).astype(level.dtype)
        level = nn.Dense(self.config.width)(jnp.concatenate([jnp.sin(waves), jnp.cos(waves)], axis=-1))
        stack = nn.scan(
            TransformerBlock,
            variable_axes={"params": 0},
            split_rngs={"params": True},
            in_axes=(nn.broadcast, nn.broadcast),
            length=self.config.depth,
            unroll=self.config.depth,  # XLA's CPU code for matrix products inside loops is several times slower
        )
        return stack(self.config, name="blocks")(tokens, nn.silu(level), angles)[0]


def _convolved(grid: jax.Array, count: int) -> jax.Array:
    for _ in range(count):
        grid = ConvBlock()(grid)
    return grid
