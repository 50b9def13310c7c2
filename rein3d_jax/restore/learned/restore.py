"""The learned restorer as a restorer: (Video, key) -> Video."""

from functools import partial
from itertools import pairwise

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.restore.background import Background
from rein3d_jax.restore.blend import keep_observed
from rein3d_jax.restore.learned.candidates import clip_of
from rein3d_jax.restore.learned.condition import Clip
from rein3d_jax.restore.learned.config import NetworkConfig
from rein3d_jax.restore.learned.loss import NOISE
from rein3d_jax.restore.learned.mixture import base
from rein3d_jax.restore.learned.predict import predict
from rein3d_jax.scene import Video

GROUP = 4  # frames: a clip is made up to a multiple of it, so that few lengths are compiled


@struct.dataclass
class Learned:
    """A trained network."""

    parameters: dict
    config: NetworkConfig = struct.field(pytree_node=False)


def restore_learned(
    video: Video,
    key: jax.Array,
    *,
    learned: Learned,
    observed: float,
    background: Background | None = None,
    steps: int = 1,
) -> Video:
    """A restorer once all keywords are bound. Frame 0 is the anchor; rows are learned.config.rows times a power of 2.

    Colour and distance of every pixel of alpha below `observed` are the network's; those above return as rendered, up
    to a soft border. One step gives the mean of what may be there and uses no randomness; more of them draw a sample,
    from a network that was trained with noise.
    """
    clip = clip_of(video, observed=observed, background=background)
    padded = jax.tree.map(partial(_padded, count=-len(clip.alpha) % GROUP), clip)
    drawn = _sample(key, learned, padded, steps)[: len(clip.alpha)]
    rgb = keep_observed(jnp.clip(drawn[..., :3], 0.0, 1.0), video.rgb, video.alpha, observed=observed)
    known = (video.alpha >= observed) & (video.distance > 0)
    return video.replace(rgb=rgb, distance=jnp.where(known, video.distance, jnp.exp(drawn[..., 3])))


def _padded(frames: jax.Array, count: int) -> jax.Array:
    """(t, ...) -> (t + count, ...), the last frame again."""
    return jnp.concatenate([frames, jnp.repeat(frames[-1:], count, axis=0)])


def _sample(key: jax.Array, learned: Learned, clip: Clip, steps: int) -> jax.Array:
    """(t, h, w, 4): sRGB and the distance's logarithm. The straight path of loss.py from level 1 down to 0."""
    start = base(clip)
    noisy = NOISE * jax.random.normal(key, start.shape)
    levels = jnp.linspace(1.0, 0.0, steps + 1)
    for level, lower in pairwise(levels):
        clean = _clean(learned, clip, noisy, level)
        noise = (noisy - (1 - level) * clean) / level
        noisy = (1 - lower) * clean + lower * noise
    return start + noisy


@jax.jit
def _clean(learned: Learned, clip: Clip, noisy: jax.Array, level: jax.Array) -> jax.Array:
    shown = jnp.where(level < 1, noisy, 0.0)  # at level 1 nothing is left of what is looked for
    clips = jax.tree.map(lambda x: x[None], clip)
    return predict(learned.parameters, clips, shown[None], level[None], config=learned.config)[0]
