"""Whether a panorama's left and right ends meet: the seam at +-180 degrees beside the columns next to it."""

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.sphere import latitudes

_LEVELS = 255  # the unit: 8-bit levels


@jax.jit
def seam_error(image: jax.Array) -> jax.Array:
    """Seam error (...) of images (..., h, w, c), sRGB in [0, 1], w >= 4: mean |jump| from the last column to the first,
    less the mean |jump| of the two pairs of columns beside it, in 8-bit levels; rows count by their area.

    A difference, since the ratio is 0 / 0 in a flat picture; signed, so that an edge which happens to stand beside the
    seam in one picture and on it in another cancels in the mean over pictures. About 0 for a picture without a seam.
    """
    around = jnp.roll(image, 2, axis=-2)[..., :4, :]  # columns w - 2, w - 1, 0, 1
    jumps = jnp.mean(jnp.abs(jnp.diff(around, axis=-2)), axis=-1)
    before, seam, after = jnp.moveaxis(_mean_over_rows(jumps), -1, 0)
    return _LEVELS * (seam - (before + after) / 2)


def _mean_over_rows(values: jax.Array) -> jax.Array:
    weights = jnp.cos(latitudes(values.shape[-2]))
    return jnp.sum(values * weights[:, None], axis=-2) / jnp.sum(weights)
