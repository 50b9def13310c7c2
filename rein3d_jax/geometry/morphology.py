"""Windows on the sphere: sums over them, their least and most, and the closing of masks; seamless across +-180 degrees
and over the poles."""

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.resample import pad_sphere


def window_sum(image: jax.Array, radius: int) -> jax.Array:
    """The sum over the (2 radius + 1)^2 pixels around each one: (h, w, ...) -> (h, w, ...)."""
    size = 2 * radius + 1
    padded = pad_sphere(image, radius)
    rows = sum(padded[i : i + image.shape[0]] for i in range(size))
    return sum(rows[:, i : i + image.shape[1]] for i in range(size))


def window_range(image: jax.Array) -> tuple[jax.Array, jax.Array]:
    """The least and the most of the 3 x 3 pixels around each one of (h, w): (h, w) each."""
    padded = pad_sphere(image, 1)
    least, most = (
        jax.lax.reduce_window(padded, start, choose, (3, 3), (1, 1), "valid")
        for start, choose in ((jnp.inf, jax.lax.min), (-jnp.inf, jax.lax.max))
    )
    return least, most


def closing(mask: jax.Array, radius: int) -> jax.Array:
    """The closing of a mask (h, w) bool: it and the gaps that no open square of side 2 radius + 1 fits into."""
    dilated = window_sum(mask.astype(jnp.float32), radius) > 0
    return mask | (window_sum((~dilated).astype(jnp.float32), radius) == 0)
