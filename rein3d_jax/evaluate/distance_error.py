"""How near a panorama's distance comes to the true one. Metres along the ray; 0 in the true map means unknown."""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.sphere import pixel_solid_angles

_NEAR_RATIO = 1.25  # the threshold of delta_1


class DistanceErrors(NamedTuple):
    """Means over the sphere's area within the mask (Eigen et al. 2014, Sec. 4.1); NaN where the mask is empty."""

    abs_rel: jax.Array  # |d - d*| / d*
    rmse: jax.Array  # metres
    delta: jax.Array  # share with max(d / d*, d* / d) < 1.25


@jax.jit
def distance_errors(estimate: jax.Array, true: jax.Array, mask: jax.Array) -> DistanceErrors:
    """Errors (...) of `estimate` (..., h, w) metres where `mask` (..., h, w), pixels weighted by solid angle.

    Pixels of unknown true distance never count. An estimate of 0, a hole, is an error unless the mask leaves it out.
    """
    assert estimate.shape == true.shape, (estimate.shape, true.shape)
    weights = pixel_solid_angles(*true.shape[-2:]) * (mask & (true > 0))
    known = jnp.where(true > 0, true, 1.0)
    error = jnp.where(true > 0, estimate - true, 0.0)
    ratio = estimate / known
    near = (ratio < _NEAR_RATIO) & (ratio * _NEAR_RATIO > 1)

    def mean(values):
        return jnp.sum(weights * values, axis=(-2, -1)) / jnp.sum(weights, axis=(-2, -1))

    return DistanceErrors(mean(jnp.abs(error) / known), jnp.sqrt(mean(error**2)), mean(near))
