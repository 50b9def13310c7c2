"""The diffusion transformer: noisy latents, timestep, text and control -> velocity (Wan2.1 with VACE's control branch).

VACE runs a chain of control blocks beside the main one; control block j hands a hint to main block j * control_every.
The chain needs nothing of the main blocks but their common input, so one scan goes through both: a step is a control
block and the `control_every` main blocks that follow its hint. No list of hints is stored, and compile time does not
grow with depth. Weights are stacked (steps, ...).
"""

import flax.linen as nn
import jax
import jax.numpy as jnp

from rein3d_jax.restore.wan.attention import attend, layer_norm, rms_norm
from rein3d_jax.restore.wan.config import DitConfig
from rein3d_jax.restore.wan.rotary import rotary_tables, rotate_pairs

_ISLAND = jnp.float32  # of norms, modulation and the timestep, in parameters and arithmetic


class Attention(nn.Module):
    """Attention of Wan: norms over all heads at once, rotary positions where given."""

    config: DitConfig

    @nn.compact
    def __call__(self, x, context, rotary=None):
        """Values (b, n, d) of x (b, n, d) attending to `context` (b, m, d); `rotary` rotates queries and keys."""
        config = self.config
        query = self.norm("query_norm", _dense(config, config.width, "query")(x))
        key = self.norm("key_norm", _dense(config, config.width, "key")(context))
        value = _dense(config, config.width, "value")(context)
        query, key, value = (
            part.reshape(*part.shape[:2], config.heads, config.head_dim) for part in (query, key, value)
        )
        if rotary is not None:
            query, key = rotate_pairs(query, *rotary), rotate_pairs(key, *rotary)
        out = attend(query, key, value, kernel=config.kernel, chunk=config.query_chunk)
        return _dense(config, config.width, "out")(out.reshape(x.shape))

    def norm(self, name, x):
        scale = self.param(name, nn.initializers.ones, (self.config.width,), _ISLAND)
        return rms_norm(x, scale, self.config.epsilon)


class DitBlock(nn.Module):
    """Block of the transformer: self-attention, attention to the text, a hidden layer."""

    config: DitConfig

    @nn.compact
    def __call__(self, x, text, modulation, rotary):
        """x (b, n, d); text (b, m, d); modulation (b, 6, d): shift, scale, gate of attention, then of the ffn."""
        config = self.config
        table = self.param("modulation", _modulation, (6, config.width), _ISLAND)
        parts = jnp.split(table + modulation, 6, axis=1)
        normed = self.modulate(x, *parts[:2])
        x = self.gated(x, Attention(config, name="self_attention")(normed, normed, rotary), parts[2])
        normed = nn.LayerNorm(
            config.epsilon, dtype=_ISLAND, param_dtype=_ISLAND, use_fast_variance=False, name="text_norm"
        )
        x = x + Attention(config, name="text_attention")(normed(x).astype(x.dtype), text)
        hidden = _dense(config, config.ffn, "ffn_in")(self.modulate(x, *parts[3:5]))
        return self.gated(x, _dense(config, config.width, "ffn_out")(nn.gelu(hidden, approximate=True)), parts[5])

    def modulate(self, x, shift, scale):
        return (layer_norm(x, self.config.epsilon) * (1 + scale) + shift).astype(x.dtype)

    def gated(self, x, update, gate):
        return (x + update * gate).astype(x.dtype)


class DitStep(nn.Module):
    """Step of the scan over depth: carry (x, control chain), scanned the hint's scale."""

    config: DitConfig

    @nn.compact
    def __call__(self, carry, hint_scale, text, modulation, rotary):
        config = self.config
        block = nn.remat(DitBlock, prevent_cse=False) if config.remat else DitBlock
        x, control = carry
        hint = 0.0
        if config.control_every:
            control = block(config, name="control")(control, text, modulation, rotary)
            zeros = nn.initializers.zeros
            hint = _dense(config, config.width, "hint", kernel_init=zeros)(control) * hint_scale.astype(control.dtype)
        for index in range(config.group):
            x = block(config, name=f"block_{index}")(x, text, modulation, rotary)
            x = x + hint if index == 0 else x
        return (x, control), None


class Dit(nn.Module):
    """The diffusion transformer."""

    config: DitConfig

    @nn.compact
    def __call__(self, latents, timestep, text, control=None, control_scale=1.0):
        """Latents (b, t, h, w, channels), timestep (b,) in [0, 1000], text (b, m, text_dim) padded with zeros, control
        (b, t, h, w, control_channels), control_scale () or one a hint -> velocity (b, t, h, w, channels) float32."""
        config, dtype = self.config, self.config.dtype
        assert (control is not None) == bool(config.control_every), "control, and config.control_every, or neither"
        grid = tuple(size // patch for size, patch in zip(latents.shape[1:4], config.patch, strict=True))
        x = _dense(config, config.width, "embed")(patchify(latents, config.patch).astype(dtype))
        chain = x
        if control is not None:
            assert control.shape[:-1] == latents.shape[:-1], (control.shape, latents.shape)
            tokens = _dense(config, config.width, "control_embed")(patchify(control, config.patch).astype(dtype))
            chain = x + _dense(config, config.width, "control_in", kernel_init=nn.initializers.zeros)(tokens)
        time, modulation = self.embed_time(timestep)
        text = _dense(config, config.width, "text_in")(text.astype(dtype))
        text = _dense(config, config.width, "text_out")(nn.gelu(text, approximate=True))
        steps = config.depth // config.group
        scales = jnp.broadcast_to(jnp.asarray(control_scale, _ISLAND), (steps,))
        scan = nn.scan(
            DitStep,
            variable_axes={"params": 0},
            split_rngs={"params": True},
            in_axes=(0, nn.broadcast, nn.broadcast, nn.broadcast),
            length=steps,
        )
        rotary = rotary_tables(grid, config.head_dim, circular=config.circular)
        (x, _), _ = scan(config, name="steps")((x, chain), scales, text, modulation, rotary)
        return unpatchify(self.head(x, time), grid, config.patch)

    def embed_time(self, timestep):
        """Embedding (b, d) of timesteps (b,) and the blocks' modulation (b, 6, d), float32."""
        width = self.config.width
        hidden = nn.silu(_island(width, "time_in")(sinusoids(timestep, self.config.frequencies)))
        time = _island(width, "time_out")(hidden)
        return time, _island(6 * width, "time_modulation")(nn.silu(time)).reshape(-1, 6, width)

    def head(self, x, time):
        config = self.config
        table = self.param("modulation", _modulation, (2, config.width), _ISLAND)
        shift, scale = jnp.split(table + time[:, None], 2, axis=1)
        x = (layer_norm(x, config.epsilon) * (1 + scale) + shift).astype(x.dtype)
        count = config.channels * config.patch[0] * config.patch[1] * config.patch[2]
        return _dense(config, count, "head")(x).astype(_ISLAND)


def sinusoids(timestep: jax.Array, count: int) -> jax.Array:
    """Embedding (b, count) of timesteps (b,): cosines, then sines, of t 10000^(-k / half)."""
    half = count // 2
    angles = timestep.astype(_ISLAND)[:, None] * jnp.exp(-jnp.log(1e4) * jnp.arange(half, dtype=_ISLAND) / half)
    return jnp.concatenate([jnp.cos(angles), jnp.sin(angles)], axis=-1)


def patchify(x: jax.Array, patch: tuple[int, int, int]) -> jax.Array:
    """Tokens (b, tokens, c pt ph pw) of (b, t, h, w, c), the channel slowest: the order of a torch Conv3d's weight."""
    b, t, h, w, c = x.shape
    assert not (t % patch[0] or h % patch[1] or w % patch[2]), (x.shape, patch)
    x = x.reshape(b, t // patch[0], patch[0], h // patch[1], patch[1], w // patch[2], patch[2], c)
    return x.transpose(0, 1, 3, 5, 7, 2, 4, 6).reshape(b, -1, c * patch[0] * patch[1] * patch[2])


def unpatchify(x: jax.Array, grid: tuple[int, int, int], patch: tuple[int, int, int]) -> jax.Array:
    """Latents (b, t, h, w, c) of tokens (b, tokens, pt ph pw c), the channel FASTEST: Wan's head is no transposed
    convolution."""
    x = x.reshape(x.shape[0], *grid, *patch, -1).transpose(0, 1, 4, 2, 5, 3, 6, 7)
    return x.reshape(x.shape[0], *(size * step for size, step in zip(grid, patch, strict=True)), -1)


def _dense(config, features, name, **options):
    return nn.Dense(features, dtype=config.dtype, param_dtype=config.param_dtype, name=name, **options)


def _island(features, name):
    return nn.Dense(features, dtype=_ISLAND, param_dtype=_ISLAND, name=name)


def _modulation(key, shape, dtype):
    return jax.random.normal(key, shape, dtype) * shape[-1] ** -0.5
