"""How well a split of the sphere into parts explains a picture's colours: their mutual information.

A line too high on a wall, or across a floor, leaves the same colours on both sides of it; furniture, which has
colours of its own, says nothing. This sees the size of a room where edges see only a choice of lines.
"""

import jax
import jax.numpy as jnp
from jax.scipy.stats import norm

from rein3d_jax.depth.picture_edges import OPPONENT
from rein3d_jax.geometry.sphere import pixel_solid_angles

ROWS = 32  # of the small picture whose pixels are counted
_LEVELS = 4  # of each opponent channel


def colour_bins(rgb: jax.Array) -> jax.Array:
    """Colour bins (2 ROWS^2, 64) of a picture (h, 2h, 3) sRGB: the bin of each pixel of it made small, one-hot, times
    its share of the sphere. A bin is a quarter of the spread of luminance and of both chroma channels; a channel with
    little spread, as in a grey picture, is held to a tenth of the strongest, so that noise stays in one bin."""
    small = jax.image.resize(rgb, (ROWS, 2 * ROWS, 3), "linear").reshape(-1, 3) @ jnp.array(OPPONENT).T
    spread = jnp.std(small, axis=0)
    quantiles = norm.cdf((small - jnp.mean(small, axis=0)) / jnp.maximum(spread, 0.1 * jnp.max(spread)))
    levels = jnp.minimum(jnp.floor(quantiles * _LEVELS), _LEVELS - 1).astype(jnp.int32)
    share = pixel_solid_angles(ROWS, 2 * ROWS).reshape(-1, 1) / (4 * jnp.pi)
    return jax.nn.one_hot(levels @ jnp.array([_LEVELS**2, _LEVELS, 1]), _LEVELS**3) * share


def mutual_information(parts: jax.Array, bins: jax.Array) -> jax.Array:
    """The information sum p(a, b) log(p(a, b) / (p(a) p(b))) in nats; `parts` (2 ROWS^2, k) is each pixel's membership
    of k parts."""
    joint = parts.T @ bins
    independent = jnp.sum(joint, axis=1, keepdims=True) * jnp.sum(joint, axis=0, keepdims=True)
    # 1e-9 keeps the gradient finite in empty bins, and is a thousandth of a pixel.
    return jnp.sum(joint * jnp.log((joint + 1e-9) / (independent + 1e-9)))
