"""The learned restorer's objective: x-prediction at noise level s of a straight path (flow matching):

    x_s = (1 - s) x_0 + s e,     loss = |x_0(x_s, s) - x_0|, weighted

where x_0 is what the fills' mean is wrong by, in colour and in the distance's logarithm.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.geometry.sphere import latitudes
from rein3d_jax.restore.learned.condition import Clip, log_distance
from rein3d_jax.restore.learned.mixture import base
from rein3d_jax.restore.noise import draw_noise
from rein3d_jax.settings import Settings, setting

_FLOOR = 1e-3  # mean penalty of a pixel below which an example has nothing left to learn from
NOISE = 0.2  # standard deviation of e, about that of x_0 in holes


@struct.dataclass
class Example:
    """A clip and its ground truth."""

    clip: Clip
    clean_rgb: jax.Array  # (..., t, h, w, 3) sRGB
    clean_distance: jax.Array  # (..., t, h, w) metres, 0 where unknown


@dataclass(frozen=True)
class LossConfig(Settings):
    """Weights of the learned restorer's loss."""

    latitude: float = setting(0.1, "weight left at the poles, lambda + (1 - lambda) cos(latitude)", within="[0, 1]")
    observed: float = setting(0.0, "weight of a pixel that was observed, against 1 in a hole", within="[0, 1]")
    distance: float = setting(0.1, "weight of the distance's logarithm beside colour", within="[0, inf)")
    gradient: float = setting(0.05, "weight of differences between neighbouring pixels of a hole", within="[0, inf)")
    knee: float = setting(0.25, "errors far below it count squared, as in PSNR, above it linearly", within="(0, inf)")


def clean_residual(example: Example) -> jax.Array:
    """x_0 (..., t, h, w, 4), what has to be added to the fills' mean: sRGB and the distance's logarithm."""
    start = base(example.clip)
    known = example.clean_distance > 0
    depth = jnp.where(known, log_distance(example.clean_distance), start[..., 3])
    return jnp.concatenate([example.clean_rgb, depth[..., None]], axis=-1) - start


def pixel_weights(alpha: jax.Array, config: LossConfig) -> jax.Array:
    """Weights (..., t, h, w): holes above what was observed, the horizon above the poles, and 0 for the anchor."""
    row = latitudes(alpha.shape[-2])[:, None]
    latitude = config.latitude + (1 - config.latitude) * jnp.cos(row)
    open_ = jnp.clip((0.9 - alpha) / 0.4, 0.0, 1.0)  # the share that the blend leaves to the network
    weights = latitude * (config.observed + (1 - config.observed) * open_)
    return weights.at[..., 0, :, :].set(0.0)


def restoration_loss(predicted: jax.Array, example: Example, config: LossConfig) -> tuple[jax.Array, jax.Array]:
    """Sum over examples (b, t, h, w) of the error over the error of the fills' mean, 1 each at the start, and b. Every
    room counts alike, as in a mean of decibels, however much of it is hidden.

    Divide after both are summed over the whole batch, and a batch in parts has the gradient of the whole."""
    wanted, weights = clean_residual(example), pixel_weights(example.clip.alpha, config)
    mine, fills = (_weighted(error, weights, config) for error in (predicted - wanted, wanted))
    floor = _FLOOR * jnp.sum(weights, axis=(1, 2, 3)) + 1e-3
    return jnp.sum((mine + floor) / (fills + floor)), jnp.float32(len(weights))


def _weighted(error: jax.Array, weights: jax.Array, config: LossConfig) -> jax.Array:
    """(b,) of errors (b, t, h, w, 4)."""
    colour, depth = jnp.mean(_penalty(error[..., :3], config.knee), axis=-1), _penalty(error[..., 3], config.knee)
    total = jnp.sum(weights * (colour + config.distance * depth), axis=(1, 2, 3))
    if config.gradient:
        for axis in (-2, -3):
            slope = error[..., :3] - jnp.roll(error[..., :3], 1, axis=axis)
            between = jnp.minimum(weights, jnp.roll(weights, 1, axis=axis + 1))
            slopes = between * jnp.mean(_penalty(slope, config.knee), axis=-1)
            total += config.gradient * jnp.sum(slopes, axis=(1, 2, 3))
    return total


def _penalty(error: jax.Array, knee: float) -> jax.Array:
    """Charbonnier's, over its knee: e^2 / (2 knee) for small e, |e| for large."""
    return jnp.sqrt(error**2 + knee**2) - knee


def noisy_residual(
    key: jax.Array, example: Example, share: float, kind: str = "latitude"
) -> tuple[jax.Array, jax.Array]:
    """x_s of one example, with noise of a `kind` of restore/noise.py, and its level s: uniform for `share` of the
    examples, 1 for the others. At level 1 nothing of x_0 is left, so 0 is shown: the network then gives the
    conditional mean, which one step needs."""
    wanted = clean_residual(example)
    if share == 0:
        return jnp.zeros_like(wanted), jnp.ones(())
    choose, draw, dots = jax.random.split(key, 3)
    level = jnp.where(jax.random.bernoulli(choose, share), jax.random.uniform(draw), 1.0)
    noise = NOISE * draw_noise(dots, wanted.shape, kind=kind)
    return jnp.where(level < 1, (1 - level) * wanted + level * noise, 0.0), level
