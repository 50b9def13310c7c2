"""The causal 3D VAE of Wan2.1: video (b, 1 + 4n, 8h, 8w, 3) in [-1, 1] <-> latents (b, 1 + n, h, w, 16), normalised.

Frame 0 has a latent of its own and no frame sees a later one. The whole clip goes through at once: the reference's
cache of chunks is the same map (encoder equal to 5e-15, decoder 2.5e-7). With `circular`, the width is padded by the
other edge, and a yaw by whole latents (8 pixels) commutes with both halves, with the same weights.
"""

import flax.linen as nn
import jax
import jax.numpy as jnp

from rein3d_jax.restore.wan.attention import attend
from rein3d_jax.restore.wan.config import VaeConfig

LATENT = 16
MEAN = (-0.7571, -0.7089, -0.9113, 0.1075, -0.1745, 0.9653, -0.1517, 1.5508)
MEAN += (0.4134, -0.0715, 0.5517, -0.3632, -0.1922, -0.9497, 0.2503, -0.2921)
STD = (2.8184, 1.4541, 2.3275, 2.6558, 1.2196, 1.7708, 2.6052, 2.0743)
STD += (3.2687, 2.1526, 2.8652, 1.5579, 1.6382, 1.1253, 2.8251, 1.9160)


class Vae(nn.Module):
    """The VAE; its parameters are those of both halves."""

    config: VaeConfig

    def setup(self):
        self.encoder = VaeEncoder(self.config)
        self.quant = _dense(self.config, 2 * LATENT)
        self.post_quant = _dense(self.config, LATENT)
        self.decoder = VaeDecoder(self.config)

    def __call__(self, video):
        """The video encoded and decoded; initialises every parameter."""
        return self.decode(self.encode(video))

    def encode(self, video: jax.Array) -> jax.Array:
        """Latents' mean (no sample), normalised to about zero mean and unit variance, float32."""
        frames, height, width = video.shape[1:4]
        time_stride, stride = self.config.time_stride, self.config.stride
        assert (frames - 1) % time_stride == 0, f"{frames} frames; pad to 1 + {time_stride} n"
        assert height % stride == 0 and width % stride == 0, f"{height} x {width}; pad to multiples of {stride}"
        mean = self.quant(self.encoder(video.astype(self.config.dtype)))[..., :LATENT].astype(jnp.float32)
        return (mean - jnp.array(MEAN)) / jnp.array(STD)

    def decode(self, latents: jax.Array) -> jax.Array:
        """Video in [-1, 1], float32."""
        latents = (latents * jnp.array(STD) + jnp.array(MEAN)).astype(self.config.dtype)
        return jnp.clip(self.decoder(self.post_quant(latents)).astype(jnp.float32), -1.0, 1.0)


class VaeEncoder(nn.Module):
    """Encoder: video to the moments of the latents."""

    config: VaeConfig

    @nn.compact
    def __call__(self, x):
        config = self.config
        x = Convolution(config, config.base, name="in")(x)
        layer = 0  # counted as in the checkpoints, through residual blocks and downsamplings alike
        for stage, multiplier in enumerate(config.multipliers):
            for _ in range(config.blocks):
                x = Residual(config, config.base * multiplier, name=f"layer_{layer}")(x)
                layer += 1
            if stage < len(config.halve_time):
                x = Downsample(config, config.halve_time[stage], name=f"layer_{layer}")(x)
                layer += 1
        return _tail(config, _middle(config, x), 2 * LATENT)


class VaeDecoder(nn.Module):
    """Decoder: latents to video."""

    config: VaeConfig

    @nn.compact
    def __call__(self, x):
        config = self.config
        multipliers, double_time = config.multipliers[::-1], config.halve_time[::-1]
        x = _middle(config, Convolution(config, config.base * multipliers[0], name="in")(x))
        layer = 0
        for stage, multiplier in enumerate(multipliers):
            for _ in range(config.blocks + 1):
                x = Residual(config, config.base * multiplier, name=f"layer_{layer}")(x)
                layer += 1
            if stage < len(double_time):
                x = Upsample(config, double_time[stage], name=f"layer_{layer}")(x)
                layer += 1
        return _tail(config, x, 3)


class Residual(nn.Module):
    """Residual block of two convolutions."""

    config: VaeConfig
    features: int

    @nn.compact
    def __call__(self, x):
        shortcut = x if x.shape[-1] == self.features else _dense(self.config, self.features, name="shortcut")(x)
        for index in (1, 2):
            x = nn.silu(Norm(name=f"norm_{index}")(x))
            x = Convolution(self.config, self.features, name=f"convolution_{index}")(x)
        return x + shortcut


class FrameAttention(nn.Module):
    """Attention of each frame to itself, with one head and no positions."""

    config: VaeConfig

    @nn.compact
    def __call__(self, x):
        channels = x.shape[-1]
        pixels = Norm(name="norm")(x).reshape(-1, x.shape[2] * x.shape[3], 1, channels)
        query, key, value = jnp.split(_dense(self.config, 3 * channels, name="query_key_value")(pixels), 3, axis=-1)
        out = attend(query, key, value)
        return x + _dense(self.config, channels, name="projection")(out).reshape(x.shape)


class Downsample(nn.Module):
    """Half the height and width, and half the time where asked for."""

    config: VaeConfig
    halve_time: bool

    @nn.compact
    def __call__(self, x):
        config, channels = self.config, x.shape[-1]
        x = pad_width(jnp.pad(x, ((0, 0), (0, 0), (0, 1), (0, 0), (0, 0))), 0, 1, circular=config.circular)
        x = _convolve(config, channels, (3, 3), (2, 2), "space")(x)
        if not self.halve_time:
            return x
        time = _convolve(config, channels, (3, 1, 1), (2, 1, 1), "time")
        # A clip of one frame needs no convolution in time, but its parameters must exist all the same.
        later = time(jnp.pad(x, ((0, 0), (0, 2), (0, 0), (0, 0), (0, 0))) if x.shape[1] == 1 else x)
        return jnp.concatenate([x[:, :1], later[:, : (x.shape[1] - 1) // 2]], axis=1)


class Upsample(nn.Module):
    """Twice the height and width, and twice the time where asked for."""

    config: VaeConfig
    double_time: bool

    @nn.compact
    def __call__(self, x):
        config, (b, t, h, w, c) = self.config, x.shape
        if self.double_time:
            # Frame 0 stays one frame and is not seen by the others: they begin after zeros of their own.
            later = jnp.pad(x[:, 1:], ((0, 0), (2, 0 if t > 1 else 1), (0, 0), (0, 0), (0, 0)))
            pairs = _convolve(config, 2 * c, (3, 1, 1), (1, 1, 1), "time")(later)[:, : t - 1]
            pairs = jnp.moveaxis(pairs.reshape(b, t - 1, h, w, 2, c), 4, 2).reshape(b, 2 * (t - 1), h, w, c)
            x = jnp.concatenate([x[:, :1], pairs], axis=1)
        x = x.repeat(2, axis=2).repeat(2, axis=3)
        x = pad_width(jnp.pad(x, ((0, 0), (0, 0), (1, 1), (0, 0), (0, 0))), 1, 1, circular=config.circular)
        return _convolve(config, c // 2, (3, 3), (1, 1), "space")(x)


class Convolution(nn.Module):
    """3 x 3 x 3 convolution, causal: two zero frames in front, none behind."""

    config: VaeConfig
    features: int

    @nn.compact
    def __call__(self, x):
        x = jnp.pad(x, ((0, 0), (2, 0), (1, 1), (0, 0), (0, 0)))
        x = pad_width(x, 1, 1, circular=self.config.circular)
        return _convolve(self.config, self.features, (3, 3, 3), (1, 1, 1), "convolution")(x)


class Norm(nn.Module):
    """x / max(|x|, 1e-12) * sqrt(channels) * scale: |x| over the channels, with a gradient at zero too."""

    @nn.compact
    def __call__(self, x):
        scale = self.param("scale", nn.initializers.ones, (x.shape[-1],), jnp.float32)
        wide = x.astype(jnp.promote_types(x.dtype, jnp.float32))
        square = jnp.square(wide).sum(axis=-1, keepdims=True)
        return (wide * jax.lax.rsqrt(jnp.maximum(square, 1e-24)) * x.shape[-1] ** 0.5 * scale).astype(x.dtype)


def pad_width(x: jax.Array, left: int, right: int, *, circular: bool) -> jax.Array:
    """x (b, t, h, w, c) with columns added: the other edge's if `circular`, else zeros."""
    return jnp.pad(x, ((0, 0), (0, 0), (0, 0), (left, right), (0, 0)), mode="wrap" if circular else "constant")


def _middle(config, x):
    x = Residual(config, x.shape[-1], name="middle_0")(x)
    x = FrameAttention(config, name="middle_1")(x)
    return Residual(config, x.shape[-1], name="middle_2")(x)


def _tail(config, x, features):
    return Convolution(config, features, name="out")(nn.silu(Norm(name="norm")(x)))


def _convolve(config, features, kernel, strides, name):
    dtypes = {"dtype": config.dtype, "param_dtype": config.param_dtype}
    return nn.Conv(features, kernel, strides=strides, padding="VALID", name=name, **dtypes)


def _dense(config, features, name=None):
    return nn.Dense(features, dtype=config.dtype, param_dtype=config.param_dtype, name=name)
