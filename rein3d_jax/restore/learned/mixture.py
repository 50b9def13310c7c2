"""Mixture of the fills: what the network's channels mean, at each pixel.

    rgb = exp(g) sum_k softmax(a)_k fill_k + contrast c,     log distance = sum_k softmax(b)_k log fill_k + d

At first all channels are 0: the fills' plain mean. Light that does not reach a hidden place darkens all of it: hence
the gain g. The correction c is in units of the clip's contrast, so that it follows the picture's tone.
"""

import jax
import jax.numpy as jnp

from rein3d_jax.restore.learned.condition import CANDIDATES, Clip, log_distance, tone

CHANNELS = 2 * CANDIDATES + 5  # shares for colour, shares for distance, gain, correction of colour, of distance
_MAX_GAIN = 1.0  # in the exponent, either way


def base(clip: Clip) -> jax.Array:
    """Mean (..., t, h, w, 4) of the fills: sRGB and the distance's logarithm."""
    depth = jnp.mean(log_distance(clip.fill_distance), axis=-1)
    return jnp.concatenate([jnp.mean(clip.fill_rgb, axis=-2), depth[..., None]], axis=-1)


def mixed(channels: jax.Array, clip: Clip) -> jax.Array:
    """Mixture (..., t, h, w, 4) by channels (..., t, h, w, CHANNELS): sRGB, not clipped, and the distance's
    logarithm."""
    colour, depth, gain, correction = jnp.split(channels, [CANDIDATES, 2 * CANDIDATES, 2 * CANDIDATES + 1], axis=-1)
    rgb = jnp.sum(jax.nn.softmax(colour)[..., None] * clip.fill_rgb, axis=-2)
    log = jnp.sum(jax.nn.softmax(depth) * log_distance(clip.fill_distance), axis=-1)
    rgb = rgb * jnp.exp(_MAX_GAIN * jnp.tanh(gain)) + tone(clip)[1] * correction[..., :3]
    return jnp.concatenate([rgb, log[..., None] + correction[..., 3:]], axis=-1)
