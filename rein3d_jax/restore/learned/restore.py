"""The learned restorer as a restorer: (Video, key) -> Video."""

from functools import partial

import jax
import jax.numpy as jnp

from rein3d_jax.restore.background import Background
from rein3d_jax.restore.blend import blend_unmatched
from rein3d_jax.restore.learned.candidates import clip_of
from rein3d_jax.restore.learned.condition import Clip
from rein3d_jax.restore.learned.sample import Learned, sample_clip
from rein3d_jax.scene import Video

# Standard deviations of the anchor's colours that a guess may go beyond its fills. The network errs by 0.07 however
# plain a room is, where fills hardly err; in a room with contrast few guesses go that far (benchmarks/README.md).
_BEYOND_FILLS = 1.5
_GROUP = 4  # frames: a clip is made up to a multiple of it, so that few lengths are compiled


def restore_learned(
    video: Video,
    key: jax.Array,
    *,
    learned: Learned,
    observed: float,
    background: Background | None = None,
    steps: int = 1,
) -> Video:
    """The restored video: a restorer once all keywords are bound. Frame 0 is the anchor; rows are learned.config.rows
    times a power of 2.

    The colour of every pixel of alpha below `observed` is the network's; those above return as rendered, up to a soft
    border. Distance is the background fill's: the network mixes surfaces at a hole's edges, and what is lifted there
    floats (distance error of the refined scene 0.157 against 0.077, mean of 8 rooms).

    One sampler step gives the mean of what may be there and uses no randomness; more of them draw a sample, from a
    network that was trained with noise.
    """
    clip = clip_of(video, observed=observed, background=background)
    count = len(clip.alpha)
    rgb = _colours(key, learned, _padded(clip, -count % _GROUP), observed, steps)[:count]
    return video.replace(rgb=rgb, distance=clip.fill_distance[..., 0])


@partial(jax.jit, static_argnums=(3, 4))
def _colours(key: jax.Array, learned: Learned, clip: Clip, observed: float, steps: int) -> jax.Array:
    drawn = sample_clip(key, learned, clip, steps)
    guess = jnp.clip(_near_fills(drawn[..., :3], clip.fill_rgb), 0.0, 1.0)
    return blend_unmatched(guess, clip.rgb, clip.alpha, observed=observed)


def _near_fills(colours: jax.Array, fills: jax.Array) -> jax.Array:
    """Colours (t, h, w, 3) within reach of their fills' (t, h, w, CANDIDATES, 3)."""
    reach = _BEYOND_FILLS * jnp.std(fills[0, :, :, 0], axis=(0, 1))
    return jnp.clip(colours, jnp.min(fills, axis=-2) - reach, jnp.max(fills, axis=-2) + reach)


@partial(jax.jit, static_argnums=1)
def _padded(clip: Clip, count: int) -> Clip:
    """The clip, its last frame shown `count` times more."""
    return jax.tree.map(lambda x: jnp.concatenate([x, jnp.repeat(x[-1:], count, axis=0)]), clip)
