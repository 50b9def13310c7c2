"""What the network's channels mean: how the fills are mixed at each pixel, and how the mixture is corrected.

    rgb = exp(g) sum_k softmax(a)_k fill_k + contrast c,     log distance = sum_k softmax(b)_k log fill_k + d

At first all channels are 0: the fills' plain mean. Light that does not reach a hidden place darkens all of it: hence
the gain g. The correction c is in units of the clip's contrast, so that it follows the picture's tone.
"""

import jax
import jax.numpy as jnp

from rein3d_jax.restore.learned.condition import FILLS, Clip, log_distance, tone

CHANNELS = 2 * FILLS + 5  # shares for colour, shares for distance, gain, correction of colour, of distance
MOST_GAIN = 1.0  # in the exponent, either way


def base(clip: Clip) -> jax.Array:
    """(..., t, h, w, 4): the fills' mean, sRGB and the distance's logarithm."""
    depth = jnp.mean(log_distance(clip.fill_distance), axis=-1)
    return jnp.concatenate([jnp.mean(clip.fill_rgb, axis=-2), depth[..., None]], axis=-1)


def mixed(channels: jax.Array, clip: Clip) -> jax.Array:
    """channels (..., t, h, w, CHANNELS) -> (..., t, h, w, 4): sRGB, not clipped, and the distance's logarithm."""
    colour, depth, gain, correction = jnp.split(channels, [FILLS, 2 * FILLS, 2 * FILLS + 1], axis=-1)
    rgb = jnp.sum(jax.nn.softmax(colour)[..., None] * clip.fill_rgb, axis=-2)
    log = jnp.sum(jax.nn.softmax(depth) * log_distance(clip.fill_distance), axis=-1)
    rgb = rgb * jnp.exp(MOST_GAIN * jnp.tanh(gain)) + tone(clip)[1] * correction[..., :3]
    return jnp.concatenate([rgb, log[..., None] + correction[..., 3:]], axis=-1)
