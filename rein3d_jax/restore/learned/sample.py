"""The learned restorer's sampler: from noise to a clip in a few steps."""

from functools import partial

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.restore.learned.condition import Clip
from rein3d_jax.restore.learned.config import NetworkConfig
from rein3d_jax.restore.learned.loss import NOISE
from rein3d_jax.restore.learned.mixture import base
from rein3d_jax.restore.learned.predict import predict
from rein3d_jax.restore.noise import draw_noise


@struct.dataclass
class Learned:
    """A trained network of the learned restorer."""

    parameters: dict
    config: NetworkConfig = struct.field(pytree_node=False)


@partial(jax.jit, static_argnames="steps")
def sample_clip(key: jax.Array, learned: Learned, clip: Clip, steps: int) -> jax.Array:
    """sRGB, not clipped, and the distance's logarithm, (t, h, w, 4), of a clip (t, h, w): down the straight path of
    loss.py from noise level 1 to 0. One step gives the mean of what may be there, whatever the key; more of them draw
    from it, if the network was trained with noise."""
    start = base(clip)
    levels = jnp.linspace(1.0, 0.0, steps + 1)

    def down(noisy, between):
        level, lower = between
        clean = _clean(learned, clip, noisy, level)
        noise = (noisy - (1 - level) * clean) / level
        return (1 - lower) * clean + lower * noise, None

    noisy = NOISE * draw_noise(key, start.shape)
    return start + jax.lax.scan(down, noisy, (levels[:-1], levels[1:]))[0]


def _clean(learned: Learned, clip: Clip, noisy: jax.Array, level: jax.Array) -> jax.Array:
    shown = jnp.where(level < 1, noisy, 0.0)  # at level 1 nothing of x_0 is left
    clips = jax.tree.map(lambda x: x[None], clip)
    return predict(learned.parameters, clips, shown[None], level[None], config=learned.config)[0]
