"""The distance network: a backbone, the horizon branch that knows rooms, the decoder that knows what stands in them,
and a gate between the two.

    log d = log background + gate x detail

Distances are along the ray, over the camera's height: a camera k times as high sees the same picture in a room k
times as large, so metres come from that height alone."""

import flax.linen as nn
import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.depth.network.backbone import Backbone
from rein3d_jax.depth.network.config import COARSEST, DepthNetworkConfig
from rein3d_jax.depth.network.convolution import GridBlock
from rein3d_jax.depth.network.horizon import Horizon, background_inverse, to_columns
from rein3d_jax.depth.network.second_look import SecondLook
from rein3d_jax.geometry.pyramid import double
from rein3d_jax.geometry.sphere import latitudes


@struct.dataclass
class DepthPrediction:
    """What the network says of panoramas (n, h, 2 h)."""

    log_distance: jax.Array  # (n, h, w) log of distance along the ray over the camera's height
    log_scale: jax.Array  # (n, h, w) log of the Laplace distribution's scale of it: how uncertain it is
    unknown: jax.Array  # (n, h, w) logit of "has no distance": sky, what is outside
    log_background: jax.Array  # (n, h, w) as log_distance, of the empty room
    gate: jax.Array  # (n, h, w) in [0, 1], how far it is not the background


class DepthNetwork(nn.Module):
    """sRGB panoramas (n, h, 2 h, 3) in [0, 1], level, h a multiple of 32 -> DepthPrediction."""

    config: DepthNetworkConfig
    frozen: int = 0  # stages of the backbone that no gradient reaches

    @nn.compact
    def __call__(self, rgb: jax.Array) -> DepthPrediction:
        _, height, width, channels = rgb.shape
        assert width == 2 * height and channels == 3 and height % COARSEST == 0, rgb.shape
        features = Backbone(self.config, self.frozen, name="backbone")(rgb)
        columns, planes = Horizon(self.config, name="horizon")(features[1:])
        look = SecondLook(self.config, name="look")
        for _ in range(self.config.looks):
            planes = look([rgb, *features[:2]], columns, planes)
        dense = Decoder(self.config, name="decoder")(features, columns, planes)
        fine = to_columns(planes, width)
        log_background = -jnp.log(background_inverse(fine[..., 0], fine[..., 1], height))
        detail, gate, log_scale, unknown = jnp.moveaxis(jax.vmap(double)(dense), -1, 0)
        gate = jax.nn.sigmoid(gate)
        return DepthPrediction(log_background + gate * detail, log_scale, unknown, log_background, gate)


class Decoder(nn.Module):
    """Features at strides 2 to 32, columns of the horizon and its planes -> (n, h / 2, w / 2, 4): detail, gate's logit,
    log scale, logit of the unknown."""

    config: DepthNetworkConfig

    @nn.compact
    def __call__(self, features: list[jax.Array], columns: jax.Array, planes: jax.Array) -> jax.Array:
        grid = None
        for skip, channels in zip(reversed(features), self.config.decoder, strict=True):
            rows = skip.shape[1]
            joined = nn.Dense(channels)(jnp.concatenate([skip, room_channels(planes, rows, skip.shape[2])], axis=-1))
            if grid is not None:
                joined = joined + jax.vmap(double)(nn.Dense(channels, use_bias=False)(grid))
            if rows == features[3].shape[1]:  # stride 16: what each column knows of its room
                joined = joined + _at_columns(nn.Dense(channels)(columns), skip.shape[2])[:, None]
            grid = GridBlock()(joined)
        return nn.Dense(4, kernel_init=nn.initializers.normal(0.01), bias_init=_first_guess)(nn.LayerNorm()(grid))


def room_channels(planes: jax.Array, rows: int, width: int) -> jax.Array:
    """Channels (n, rows, width, 3) that say where the room's background is and how high a row looks."""
    at = _at_columns(planes, width) if width <= planes.shape[1] else to_columns(planes, width)
    inverse = background_inverse(at[..., 0], at[..., 1], rows)
    latitude = jnp.broadcast_to(latitudes(rows)[:, None], inverse.shape)
    return jnp.stack([-jnp.log(inverse), jnp.sin(latitude), jnp.cos(latitude)], axis=-1)


def _at_columns(columns: jax.Array, count: int) -> jax.Array:
    """Columns (n, count, c) of (n, w, c), averaged, w a multiple of count."""
    return columns.reshape(columns.shape[0], count, -1, columns.shape[-1]).mean(2)


def _first_guess(key: jax.Array, shape: tuple[int, ...], dtype=jnp.float32) -> jax.Array:
    """Half open gate, a scale of e^-2, and distance known."""
    return jnp.array([0.0, 0.0, -2.0, -2.0], dtype)


def initial_depth_parameters(key: jax.Array, config: DepthNetworkConfig = DepthNetworkConfig()) -> dict:
    """Parameters of an untrained network."""
    # Compiled: layer by layer it is 800 programs.
    return jax.jit(DepthNetwork(config).init)(key, jnp.zeros((1, COARSEST, 2 * COARSEST, 3)))["params"]


def estimate_depth(parameters: dict, rgb: jax.Array, config: DepthNetworkConfig) -> DepthPrediction:
    """The DepthPrediction of sRGB panoramas (n, h, 2 h, 3) in [0, 1], h a multiple of 32."""
    return DepthNetwork(config).apply({"params": parameters}, rgb)
