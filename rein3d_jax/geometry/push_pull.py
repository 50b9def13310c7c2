"""Push-pull filling of an equirectangular image (Gortler et al. 1996), with an option to prefer the far side.

Pull: each 2 x 2 block becomes the weighted mean of what it knows. Push: from the coarsest level down, a cell keeps
what it knows and takes the rest from the level above. With `prefer_far` the last channel is inverse distance: a
block's near cells lose weight against its far ones, and a cell that is nearer than the background found so far is
not accepted.
"""

from functools import partial

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.pyramid import blocks, double, levels
from rein3d_jax.geometry.resample import pad_sphere

_NEARER = 12.0  # how sharply a cell loses trust per e-fold that it is nearer than its background
# A surface seen at a slant changes distance from cell to cell; so much is not yet "nearer" (relative, and per pixel of
# cell size: on a floor 1.6 m below, 4 m away and 128 rows to the panorama, a row is 6 % of the distance).
_TOLERANCE, _TOLERANCE_PER_PIXEL = 0.1, 0.02


@partial(jax.jit, static_argnames="prefer_far")  # several programs fill pictures of one size: it is traced once
def push_pull(
    image: jax.Array, weight: jax.Array, *, otherwise: jax.Array | None = None, prefer_far: bool = False
) -> jax.Array:
    """The filled image: (h, w, c), weight (h, w) in [0, 1] -> (h, w, c), `image` where the weight is 1.

    `otherwise` (c,) is what an image without any weight becomes; None: its weighted mean, 0.
    """
    stack = [(image, weight)]
    for level in range(levels(image.shape[0])):
        stack.append(_pull(*stack[-1], level, prefer_far))
    top, share = stack.pop()
    mean = jnp.sum(top * share[..., None], axis=(0, 1)) / jnp.maximum(jnp.sum(share), 1e-6)
    if otherwise is not None:
        mean = jnp.where(jnp.sum(share) > 0, mean, otherwise)
    filled = share[..., None] * top + (1 - share[..., None]) * mean
    for level in reversed(range(len(stack))):
        cells, share = stack[level]
        background = _double_far(filled, level + 1) if prefer_far else double(filled)
        if prefer_far:
            share = share * _trust(cells[..., -1], background[..., -1], level)
        filled = share[..., None] * cells + (1 - share[..., None]) * background
    return filled


def _trust(inverse, background, level):
    """The trust in [0, 1]: 1 unless `inverse` distance says nearer than `background` by more than the tolerance."""
    tolerance = _TOLERANCE + _TOLERANCE_PER_PIXEL * 2**level
    excess = jnp.log(jnp.maximum(inverse, 1e-6)) - jnp.log(jnp.maximum(background, 1e-6)) - tolerance
    return jnp.exp(-_NEARER * jnp.maximum(excess, 0.0))


def _double_far(image, level):
    """`double`, where each cell counts by how far it is among its neighbours: a coarse cell that holds nothing but an
    object and its hole would otherwise be smeared over the background beside it."""
    inverse = pad_sphere(image[..., -1], 1)
    height, width = image.shape[:2]
    shifts = [inverse[i : i + height, j : j + width] for i in range(3) for j in range(3)]
    trust = _trust(image[..., -1], jnp.min(jnp.stack(shifts), axis=0), level)[..., None]
    return double(image * trust) / jnp.maximum(double(trust), 1e-9)


def _pull(image, weight, level, prefer_far):
    """The next coarser level, and the share of it that is known."""
    cells, shares = blocks(image), blocks(weight)
    trust = shares
    if prefer_far:
        farthest = jnp.min(jnp.where(shares > 0, cells[..., -1], jnp.inf), axis=2, keepdims=True)
        trust = shares * _trust(cells[..., -1], jnp.where(jnp.isfinite(farthest), farthest, 1.0), level)
    mean = jnp.sum(cells * trust[..., None], axis=2) / jnp.maximum(jnp.sum(trust, axis=2), 1e-6)[..., None]
    return mean, jnp.minimum(jnp.sum(shares, axis=2), 1.0)
