"""What is still unseen: space behind the surfaces that the input panorama saw, the only place for a guess.

Whatever lies in front of an observed surface would have been seen; so a restored surface found there is wrong, however
well it renders where it was restored, and would stand in the way everywhere else.
"""

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.sphere import holding_pixels, pixels_from_rays
from rein3d_jax.scene import Panorama

_STEPS = 24  # places tried along a ray, 6 % apart; even, so that the guess itself is one of them
DOUBTFUL = 0.2  # relative error expected of a distance above which what was lifted there may be wrong
_MARGIN = 0.02  # relative: what lies this little in front of a surface lies on it


def relative_distance(panorama: Panorama, points: jax.Array) -> jax.Array:
    """The distance of points (..., 3), world, over that of the surface which `panorama` (at the world's origin) shows
    in their direction: (...), below 1 where space was seen to be empty, above 1 where it is hidden."""
    return jnp.linalg.norm(points, axis=-1) / jnp.maximum(_in_direction(panorama.distance, points), 1e-6)


def _in_direction(image: jax.Array, points: jax.Array) -> jax.Array:
    """The pixel (...) of a panorama's image (h, w) that shows points (..., 3)."""
    return image[holding_pixels(*pixels_from_rays(points, *image.shape), *image.shape)]


@jax.jit
def in_doubt(panorama: Panorama, points: jax.Array) -> jax.Array:
    """Whether the distance that `panorama` shows in the direction of points (..., 3) is doubtful: (...) bool."""
    if panorama.doubt is None:
        return jnp.zeros(points.shape[:-1], bool)
    return _in_direction(panorama.doubt, points) > DOUBTFUL


@jax.jit
def on_observed(panorama: Panorama, points: jax.Array) -> jax.Array:
    """Whether points (..., 3) lie on the surface that `panorama` shows, or before it: (...) bool."""
    return relative_distance(panorama, points) <= 1 + _MARGIN


@jax.jit
def hidden_distance(panorama: Panorama, origin: jax.Array, rays: jax.Array, guess: jax.Array) -> jax.Array:
    """The hidden place nearest to `guess` (h, w) metres along `rays` (h, w, 3) from `origin` (3,), world frame.

    Hidden at or behind the surface that `panorama` (at the world's origin) shows in that direction. 0 where the ray
    crosses no hidden place within twice the guess: a guess that would stand in seen space is no guess.
    """
    # From half the guess to twice it, evenly in log distance; the guess itself is one of the places.
    factors = 2.0 ** jnp.linspace(-1.0, 1.0, _STEPS + 1)

    def cost(factor):
        hidden = relative_distance(panorama, origin + rays * (guess * factor)[..., None]) >= 1 - _MARGIN
        return jnp.where(hidden, jnp.abs(jnp.log(factor)), jnp.inf)

    def nearest(best, factor):
        lowest, chosen = best
        this = cost(factor)
        return (jnp.minimum(lowest, this), jnp.where(this < lowest, factor, chosen)), None

    start = (jnp.full(guess.shape, jnp.inf), jnp.zeros_like(guess))
    (_, chosen), _ = jax.lax.scan(nearest, start, factors)
    return guess * chosen
