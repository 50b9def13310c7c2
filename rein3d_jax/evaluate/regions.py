"""What the input panorama knows of a view: each pixel's surface was seen from the origin, was hidden from it, or is
nothing known. World frame, metres along the ray."""

import jax
import jax.numpy as jnp

from rein3d_jax.evaluate.inverse_distance import sample_inverse_distance
from rein3d_jax.scene import Panorama

NEVER_SEEN, OBSERVED, DISOCCLUDED = 0, 1, 2  # a pixel's region

_RELATIVE = 0.02  # a surface this little behind the one that was seen is that one
_ABSOLUTE = 0.02  # metres; the same, for surfaces within a metre


@jax.jit
def regions_of_view(panorama: Panorama, origin: jax.Array, rays: jax.Array, true_distance: jax.Array) -> jax.Array:
    """Region (h, w) int32 of each pixel of a view from `origin` (3,) along unit `rays` (h, w, 3), world frame,
    whose surfaces lie at `true_distance` (h, w), 0 where unknown. `panorama` stands at the world's origin.

    OBSERVED     the surface is no farther from the world's origin than what the panorama saw there, + 2 % + 2 cm
    DISOCCLUDED  it is farther: hidden behind what the panorama saw
    NEVER_SEEN   its distance, or what the panorama saw in its direction, is unknown
    """
    points = origin + rays * true_distance[..., None]
    seen, known = sample_inverse_distance(jnp.where(panorama.valid, panorama.distance, 0.0), points)
    # r <= (1 + _RELATIVE) / seen + _ABSOLUTE, with `seen` in 1 / m
    observed = (jnp.linalg.norm(points, axis=-1) - _ABSOLUTE) * seen <= 1 + _RELATIVE
    region = jnp.where(observed, OBSERVED, DISOCCLUDED)
    return jnp.where(known & (true_distance > 0), region, NEVER_SEEN)
