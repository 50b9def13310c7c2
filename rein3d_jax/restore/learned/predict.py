"""One evaluation of the network: a clip, its noisy residual and the noise level in, the clean residual out.

The network works on `config.rows` rows: what can be known of a hole is coarse, and four times fewer pixels are four
times more clips to learn from. Its channels are enlarged, and mix the fills at full resolution.
"""

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.pyramid import blocks, double
from rein3d_jax.restore.learned.condition import Clip, log_distance, network_features
from rein3d_jax.restore.learned.config import NetworkConfig
from rein3d_jax.restore.learned.mixture import base, mixed
from rein3d_jax.restore.learned.network import Network


def predict(
    parameters: dict, clip: Clip, noisy: jax.Array, level: jax.Array, *, config: NetworkConfig, dtype=jnp.float32
) -> jax.Array:
    """x_0 (b, t, h, w, 4), what has to be added to the fills' mean, of clips (b, t, h, w), noisy (b, t, h, w, 4) and
    level (b,); float32, the network in `dtype`. h is config.rows times a power of 2."""
    halvings, small = 0, (clip, noisy)
    while small[1].shape[2] > config.rows:
        halvings, small = halvings + 1, (halved_clip(small[0]), _halve(small[1]))
    assert small[1].shape[2] == config.rows, f"{noisy.shape[2]} rows, not {config.rows} times a power of 2"
    given = jax.tree.map(lambda x: x.astype(dtype), (parameters, network_features(*small), level))
    channels = Network(config).apply({"params": given[0]}, *given[1:]).astype(jnp.float32)
    for _ in range(halvings):
        channels = _over_frames(double, channels)
    return mixed(channels, clip) - base(clip)


def halved_clip(clip: Clip) -> Clip:
    """The clip (b, t, h, w) with every 2 x 2 pixels as one; what was rendered counts by its alpha, distances by their
    logarithm."""
    alpha = _halve(clip.alpha)
    weight = clip.alpha * (clip.distance > 0)
    share = _halve(weight)
    depth = _halve(weight * log_distance(clip.distance)) / jnp.maximum(share, 1e-6)
    return Clip(
        rgb=_halve(clip.rgb * clip.alpha[..., None]) / jnp.maximum(alpha, 1e-6)[..., None],
        alpha=alpha,
        distance=jnp.where(share > 0, jnp.exp(depth), 0.0),
        fill_rgb=_halve(clip.fill_rgb),
        fill_distance=jnp.exp(_halve(log_distance(clip.fill_distance))),
        position=clip.position,
    )


def _halve(image: jax.Array) -> jax.Array:
    """(b, t, h, w, ...) -> (b, t, h / 2, w / 2, ...)."""
    return _over_frames(lambda frame: jnp.mean(blocks(frame), axis=2), image)


def _over_frames(change, image: jax.Array) -> jax.Array:
    return jax.vmap(jax.vmap(change))(image)
