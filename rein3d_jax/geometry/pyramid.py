"""Halving and doubling of equirectangular images, seamless across +-180 degrees and over the poles."""

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.resample import pad_sphere


def levels(height: int) -> int:
    """The number of times that `height` (and with it the width, twice that) can be halved, leaving at least 2 rows."""
    count = 0
    while height % 2 == 0 and height > 2:
        height, count = height // 2, count + 1
    return count


def blocks(image: jax.Array) -> jax.Array:
    """The 2 x 2 pixels under each pixel of the next level: (h, w, ...) -> (h / 2, w / 2, 4, ...)."""
    height, width = image.shape[:2]
    split = image.reshape(height // 2, 2, width // 2, 2, *image.shape[2:])
    return jnp.moveaxis(split, 2, 1).reshape(height // 2, width // 2, 4, *image.shape[2:])


def halve(image: jax.Array) -> jax.Array:
    """The image at half the size, each pixel the mean of 2 x 2: (h, w, ...) -> (h / 2, w / 2, ...)."""
    return blocks(image).mean(axis=2)


def double(image: jax.Array) -> jax.Array:
    """The image at twice the size, bilinear: weights 3/4 and 1/4, as the new centres lie. (h, w, ...) -> (2 h, 2 w,
    ...)."""
    height, width = image.shape[:2]
    padded = pad_sphere(image, 1)
    middle = padded[1:-1]
    rows = jnp.stack([0.75 * middle + 0.25 * padded[:-2], 0.75 * middle + 0.25 * padded[2:]], axis=1)
    rows = rows.reshape(2 * height, width + 2, *image.shape[2:])
    middle = rows[:, 1:-1]
    columns = jnp.stack([0.75 * middle + 0.25 * rows[:, :-2], 0.75 * middle + 0.25 * rows[:, 2:]], axis=2)
    return columns.reshape(2 * height, 2 * width, *image.shape[2:])
