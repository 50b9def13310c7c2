"""How much of what surrounds a camera has been seen."""

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.sphere import pixel_solid_angles

_SEEN = 0.5  # alpha above which a pixel shows more scene than hole


@jax.jit
def coverage(alpha: jax.Array) -> jax.Array:
    """Share (...) of the sphere, by solid angle, where equirectangular alpha (..., h, w) is above 0.5."""
    areas = pixel_solid_angles(*alpha.shape[-2:])
    return jnp.sum((alpha > _SEEN) * areas, axis=(-2, -1)) / jnp.sum(areas)
