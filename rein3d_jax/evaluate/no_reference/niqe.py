"""NIQE: how far a picture's statistics lie from those of pristine photographs (Mittal, Soundararajan, Bovik 2013).

No reference is needed; less is better, photographs have about 2 to 5. It was made of outdoor photographs: use it to
compare methods on the same views, not as an absolute measure of a rendered room."""

from collections.abc import Mapping
from functools import partial

import jax
import jax.numpy as jnp

from rein3d_jax.evaluate.no_reference.natural_scene import (
    Moments,
    fit_bell,
    halved,
    mean_of_width,
    moments,
    normalised_brightness,
    width_of_deviation,
)

_BLOCK = 96  # pixels of a side, the authors' choice
_LUMA, _BLACK = (65.481, 128.553, 24.966), 16.0  # ITU-R BT.601: Y of YCbCr, 16 to 235
# MATLAB's imresize: Keys's cubic (a = -1/2) stretched by two, at 1/4, 3/4, 5/4, 7/4 of the coarser pixel's width
_CUBIC = (-0.01171875, -0.03515625, 0.11328125, 0.43359375, 0.43359375, 0.11328125, -0.03515625, -0.01171875)
_NEIGHBOURS = ((0, 1), (1, 0), (1, 1), (1, -1))  # right, down, and the two diagonals


@jax.jit
def niqe(params: Mapping[str, jax.Array], image: jax.Array) -> jax.Array:
    """NIQE (...) of images (..., h, w, 3), sRGB in [0, 1]; `params`: `io.weights.metric_weights.niqe_weights`.

    Only whole blocks of 96 x 96 pixels count, at least two of them. NaN where fewer than two blocks have texture.
    """
    rows, columns = image.shape[-3] // _BLOCK, image.shape[-2] // _BLOCK
    assert rows * columns >= 2, f"{image.shape} has not two blocks of {_BLOCK}"
    return jnp.vectorize(partial(_of_one, params), signature="(h,w,c)->()")(image)


def _of_one(params: Mapping[str, jax.Array], image: jax.Array) -> jax.Array:
    height, width = (size // _BLOCK * _BLOCK for size in image.shape[:2])
    luma = jnp.matmul(image[:height, :width], jnp.array(_LUMA), precision=jax.lax.Precision.HIGHEST)
    plane = jnp.round(luma + _BLACK)  # the authors' code takes 8-bit pictures
    coarse = halved(plane, _CUBIC, beyond="symmetric")
    features = jnp.concatenate([_block_features(plane, _BLOCK), _block_features(coarse, _BLOCK // 2)], axis=1)
    return _distance(params, features)


def _distance(params: Mapping[str, jax.Array], features: jax.Array) -> jax.Array:
    """sqrt(d (C1 + C2)^-1 2 d) of (blocks, 36) features (eq. 10), in the basis where the pristine C1 is the identity.
    A block with a NaN has no part in C2, as in the authors' code."""
    exact = partial(jnp.matmul, precision=jax.lax.Precision.HIGHEST)
    whole = ~jnp.isnan(features).any(axis=1)
    count = jnp.sum(whole)
    centre = jnp.sum(jnp.where(whole[:, None], features, 0.0), axis=0) / count
    spread = exact(jnp.where(whole[:, None], features - centre, 0.0), params["whitening"].T)
    covariance = exact(spread.T, spread) / jnp.where(count > 1, count - 1, jnp.nan)
    away = exact(params["whitening"], jnp.nanmean(features, axis=0) - params["mean"])
    return jnp.sqrt(exact(away, jnp.linalg.solve((jnp.eye(len(away)) + covariance) / 2, away)))


def _block_features(plane: jax.Array, size: int) -> jax.Array:
    """(h, w) -> (blocks, 18): the shape and mean width of the brightness; shape, mean and widths (eq. 8) of its product
    with each neighbour."""
    normalised = normalised_brightness(plane, beyond="edge")
    rows, columns = (length // size for length in plane.shape)
    blocks = normalised.reshape(rows, size, columns, size).swapaxes(1, 2).reshape(-1, size, size)
    shape, left, right = fit_bell(jax.vmap(_moments)(blocks))  # (blocks, 5) each
    shape = jnp.round(shape, 3)  # the authors' search goes in steps of 0.001, which moves the result by up to 0.02
    left, right = left * width_of_deviation(shape), right * width_of_deviation(shape)
    products = jnp.stack([shape, (right - left) * mean_of_width(shape), left, right], axis=-1)[:, 1:]
    brightness = jnp.stack([shape, (left + right) / 2], axis=-1)[:, 0]
    return jnp.concatenate([brightness, products.reshape(len(blocks), -1)], axis=1)


def _moments(block: jax.Array) -> Moments:
    """Of the block and of its product with each neighbour (5,), wrapping at its edges as the authors' code does."""
    products = [block * jnp.roll(block, shift, axis=(0, 1)) for shift in _NEIGHBOURS]
    return jax.vmap(partial(moments, zero_is_right=False))(jnp.stack([block, *products]))
