"""A map brought to a picture's edges: the guided filter (He, Sun and Tang 2013), on the sphere, its windows taken from
a smaller copy where the picture is large (He and Sun 2015)."""

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.morphology import window_sum

_ROWS = 256  # of the copy at most
_REACH = 10  # of its pixels by which the edges of a picture can move those of a map
_NOISE = 0.01  # sRGB, below which the picture has no edge


def guided_by(picture: jax.Array, image: jax.Array) -> jax.Array:
    """The map (h, 2 h) as each window around a pixel would predict it from the picture (h, 2 h, 3) in sRGB, linearly:
    its steps go to where the picture's are near them, and it is smooth where the picture has none."""
    height, width = image.shape
    rows = min(_ROWS, height)
    small = jax.image.resize(jnp.concatenate([picture, image[..., None]], axis=-1), (rows, 2 * rows, 4), "linear")
    slope = jax.image.resize(_predictors(small[..., :3], small[..., 3]), (height, width, 4), "linear")
    return jnp.sum(slope[..., :3] * picture, axis=-1) + slope[..., 3]


def _predictors(picture: jax.Array, image: jax.Array) -> jax.Array:
    """Slopes and offset (h, w, 4) by which windows predict the map from colours, mean of the windows over a pixel."""

    def mean(x):
        return window_sum(x, _REACH) / (2 * _REACH + 1) ** 2

    colour, value = mean(picture), mean(image)
    products = mean(picture[..., :, None] * picture[..., None, :]) - colour[..., :, None] * colour[..., None, :]
    shared = mean(picture * image[..., None]) - colour * value[..., None]
    slope = jnp.linalg.solve(products + _NOISE**2 * jnp.eye(3), shared[..., None])[..., 0]
    offset = value - jnp.sum(slope * colour, axis=-1)
    return mean(jnp.concatenate([slope, offset[..., None]], axis=-1))
