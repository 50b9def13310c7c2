"""BRISQUE: a picture's quality as people would rate it, learnt from spoilt photographs (Mittal, Moorthy, Bovik 2012).

No reference is needed; less is better, about 0 to 100. Its people saw photographs with JPEG, noise and blur: use it to
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

_GREY = (0.2125, 0.7154, 0.0721)  # scikit-image's rgb2gray, as in the package whose model this is
_CUBIC = (-0.09375, 0.59375, 0.59375, -0.09375)  # OpenCV's INTER_CUBIC (a = -3/4) at half size


@jax.jit
def brisque(params: Mapping[str, jax.Array], image: jax.Array) -> jax.Array:
    """BRISQUE (...) of images (..., h, w, 3), sRGB in [0, 1]; `params` are those of
    `io.weights.metric_weights.brisque_weights`. An odd last row or column is left out. NaN for a flat picture."""
    return jnp.vectorize(partial(_of_one, params), signature="(h,w,c)->()")(image)


def _of_one(params: Mapping[str, jax.Array], image: jax.Array) -> jax.Array:
    height, width = (size // 2 * 2 for size in image.shape[:2])
    exact = partial(jnp.matmul, precision=jax.lax.Precision.HIGHEST)
    plane = 255 * exact(image[:height, :width], jnp.array(_GREY))
    features = _features([plane, halved(plane, _CUBIC, beyond="edge")])
    scaled = 2 * (features - params["low"]) / (params["high"] - params["low"]) - 1
    # an epsilon-SVR: sum of coefficients exp(-gamma |x - vector|^2), less rho
    distances = jnp.sum((params["vectors"] - scaled) ** 2, axis=1)
    return jnp.sum(params["coefficients"] * jnp.exp(-params["gamma"] * distances)) - params["rho"]


def _features(planes: list[jax.Array]) -> jax.Array:
    """Each scale's (h, w) -> (18 scales,): shape and variance of the normalised brightness; shape, mean and variance of
    either side of its product with the pixel to the right, below, and on both diagonals (Table I)."""
    of_each = [_moments(plane) for plane in planes]
    shape, left, right = fit_bell(jax.tree.map(lambda *scales: jnp.stack(scales), *of_each))  # (scales, 5) each
    mean = (right - left) * width_of_deviation(shape) * mean_of_width(shape)
    products = jnp.stack([shape, mean, left**2, right**2], axis=-1)[:, 1:]
    brightness = jnp.stack([shape, (left**2 + right**2) / 2], axis=-1)[:, 0]
    return jnp.concatenate([brightness, products.reshape(len(planes), -1)], axis=1).ravel()


def _moments(plane: jax.Array) -> Moments:
    """(h, w) -> (5,): of the normalised brightness, and of its four products with neighbours within the picture."""
    x = normalised_brightness(plane, beyond="constant")
    products = (x[:, :-1] * x[:, 1:], x[:-1] * x[1:], x[:-1, :-1] * x[1:, 1:], x[1:, :-1] * x[:-1, 1:])
    of_each = [moments(values, zero_is_right=True) for values in (x, *products)]
    return jax.tree.map(lambda *values: jnp.stack(values), *of_each)
