"""Inverse distances of panoramas: the right thing to interpolate, since a plane's 1 / d is n . ray / offset, smooth in
the ray, where its d runs off to infinity at the horizon."""

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.resample import sample_sphere
from rein3d_jax.geometry.sphere import pixels_from_rays


def sample_inverse_distance(distance: jax.Array, rays: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Bilinear 1 / metres (...) of an equirectangular `distance` (h, w), 0 where unknown, in directions `rays`
    (..., 3) of any length in its own frame; and whether it is known there: most of the weight is."""
    known = distance > 0
    inverse = jnp.where(known, 1 / jnp.where(known, distance, 1.0), 0.0)
    u, v = pixels_from_rays(rays, *distance.shape)
    total, share = sample_sphere(inverse, u, v), sample_sphere(known.astype(inverse.dtype), u, v)
    return total / jnp.where(share > 0, share, 1.0), share > 0.5
