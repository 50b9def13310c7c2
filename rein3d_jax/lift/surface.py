"""Which way the surface runs at each pixel of a panorama, where it breaks off, and the axes that follow it.

Over a plane, inverse distance is linear in the direction of the ray, so the surface's slope

    w = gradient of log(distance) over the sphere, per radian        (|w| = tangent of the angle of incidence)

is exact there. Slopes are limited (van Leer 1977): beside a depth edge the step on the far side does not count, and
across a crease there is none.
"""

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.resample import pad_sphere
from rein3d_jax.geometry.safe import safe_norm
from rein3d_jax.geometry.sphere import latitudes


def slopes(distance: jax.Array, known: jax.Array) -> jax.Array:
    """The slope w (h, w, 2) of distances (h, w), towards growing columns and upward; 0 beside what is not known."""
    height = distance.shape[0]
    inverse = jnp.where(known, 1 / jnp.where(known, distance, 1.0), 0.0)
    image = pad_sphere(jnp.stack([inverse, known.astype(inverse.dtype)], axis=-1), 1)
    right = _limited(image[1:-1, :-2], image[1:-1, 1:-1], image[1:-1, 2:])
    up = _limited(image[2:, 1:-1], image[1:-1, 1:-1], image[:-2, 1:-1])
    pitch = jnp.pi / height
    per_radian = jnp.stack([right / (pitch * jnp.cos(latitudes(height))[:, None]), up / pitch], axis=-1)
    return -per_radian * jnp.where(known, distance, 1.0)[..., None]


def _limited(before: jax.Array, here: jax.Array, after: jax.Array) -> jax.Array:
    """Step of [..., 0] from pixel to pixel: the central one, but at most twice each side's."""
    first, second = (here - before)[..., 0], (after - here)[..., 0]
    least = jnp.minimum(jnp.abs(first + second) / 2, 2 * jnp.minimum(jnp.abs(first), jnp.abs(second)))
    agree = (first * second > 0) & (before[..., 1] * here[..., 1] * after[..., 1] == 1)
    return jnp.where(agree, jnp.sign(first) * least, 0.0)


def beside_steps(inverse: jax.Array, step: float) -> jax.Array:
    """Pixels (h, w) bool beside a step: a neighbour's inverse distance differs by a slope of which those before and
    after know nothing, `step` relative to the nearer surface."""
    image = pad_sphere(inverse, 2)
    right = _steps(image[2:-2], 1, step)
    down = _steps(image[:, 2:-2], 0, step)
    return right[:, 1:] | right[:, :-1] | down[1:] | down[:-1]


def _steps(image: jax.Array, axis: int, step: float) -> jax.Array:
    """Links along `axis`, one more than there are pixels within a padding of 2."""
    links = image.shape[axis] - 3
    a, b, c, d = (jax.lax.slice_in_dim(image, start, start + links, axis=axis) for start in range(4))
    rise = c - b
    sudden = jnp.minimum(jnp.abs(rise - (b - a)), jnp.abs(rise - (d - c)))
    return sudden > step * jnp.maximum(b, c)


def axes_at(ray: jax.Array, slope: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Orthonormal axes (..., 3, 3) as columns at rays (..., 3) with slopes (..., 2); tangents of incidence (...); the
    unit vector (..., 2), towards growing columns and upward, along which the surface falls away.

    The first axis runs along the surface where it falls away most, the second across it, the third is its normal. Seen
    from the panorama's centre, a disc stretched along the first by sqrt(1 + tangent^2) is round.
    """
    steep = safe_norm(slope)
    some = steep > 1e-6
    way = jnp.where(some[..., None], slope / jnp.where(some, steep, 1.0)[..., None], jnp.array([1.0, 0.0]))
    right = jnp.stack([ray[..., 1], -ray[..., 0], jnp.zeros_like(steep)], axis=-1)
    right /= safe_norm(right, keepdims=True)  # no pixel's ray is a pole
    along = way[..., :1] * right + way[..., 1:] * jnp.cross(right, ray)
    first = (along + steep[..., None] * ray) / jnp.sqrt(1 + steep**2)[..., None]
    second = jnp.cross(ray, along)
    return jnp.stack([first, second, jnp.cross(first, second)], axis=-1), steep, way
