"""What of a clip the Frechet distance compares. The name says which: only I3D's features make it an FVD."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp

from rein3d_jax.evaluate.alexnet import alexnet
from rein3d_jax.evaluate.i3d import MIN_FRAMES, SIDE, Params, i3d


class ClipFeatures(NamedTuple):
    """A distance's name for tables, and its features: (params, frames (t, h, w, 3) sRGB in [0, 1]) -> (d,)."""

    label: str
    of_clip: Callable[[Params, jax.Array], jax.Array]
    frames: int  # that a clip must have


@jax.jit
def _alexnet_features(params: Params, frames: jax.Array) -> jax.Array:
    """(512,): the last convolution's 256 channels, averaged over the clip; and their mean |change| from frame to frame
    at each place, so that a clip that trembles differs from one that does not."""
    last = alexnet(params, frames)[-1]
    return jnp.concatenate([last.mean(axis=(0, 1, 2)), jnp.abs(jnp.diff(last, axis=0)).mean(axis=(0, 1, 2))])


@jax.jit
def _i3d_features(params: Params, frames: jax.Array) -> jax.Array:
    """(400,): logits of the clip squeezed to 224 x 224, as FVD's authors do, whatever its aspect."""
    resized = jax.image.resize(frames, (len(frames), SIDE, SIDE, 3), "linear", antialias=False)
    return i3d(params, resized[None])[0]


# params: io.weights.metric_weights.lpips_weights; h and w >= 31
ALEXNET = ClipFeatures("Frechet distance (AlexNet features)", _alexnet_features, 2)
# params: io.weights.metric_weights.i3d_weights, from a file that the user converts
I3D = ClipFeatures("FVD (I3D, Kinetics-400 logits)", _i3d_features, MIN_FRAMES)
