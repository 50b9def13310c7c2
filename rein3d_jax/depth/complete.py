"""A distance for the pixels that have none, so that what the photograph shows there has a place.

Specks take a smooth estimate from the surface around them. Larger unknown regions are windows and open doors: what
shows through them is far away, and a copy of it pasted onto the wall would move wrongly with every step of the
camera. The mask of what is known is the caller's and stays what it was: an estimate is not an observation.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.morphology import closing
from rein3d_jax.geometry.push_pull import push_pull
from rein3d_jax.settings import Settings, setting


@dataclass(frozen=True)
class CompleteConfig(Settings):
    """The completion's settings: where the pixels of unknown distance are placed."""

    speck: int = setting(4, "radius of holes that belong to the surface around them", within="[0, inf)", unit="pixels")
    far: float = setting(10.0, "distance of everything else unknown, over the median known distance", within="[1, inf)")


def _complete_distance(distance: jax.Array, valid: jax.Array, *, config: CompleteConfig) -> jax.Array:
    """The distance of every pixel: (h, w) metres, (h, w) bool -> (h, w) metres, equal to `distance` where valid, finite
    everywhere whatever stands in the unknown pixels. Where nothing at all is known: 0. Inverse distance is what is
    averaged: a plane's is linear in the ray, so a smooth fill bends a wall little, and far things do not outvote near
    ones."""
    assert distance.shape == valid.shape, (distance.shape, valid.shape)
    inverse = jnp.where(valid, 1 / jnp.where(valid, distance, 1.0), 0.0)[..., None]
    smooth = push_pull(inverse, valid.astype(distance.dtype))[..., 0]
    near = jnp.where(smooth > 0, 1 / jnp.where(smooth > 0, smooth, 1.0), 0.0)
    median = jnp.nanmedian(jnp.where(valid, distance, jnp.nan))
    far = jnp.where(jnp.isnan(median), 0.0, config.far * median)
    guess = jnp.where(closing(valid, config.speck), near, jnp.maximum(far, near))
    return jnp.where(valid, distance, guess)


complete_distance = jax.jit(_complete_distance, static_argnames=("config",))
