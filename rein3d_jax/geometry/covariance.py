"""The 3D covariance of a Gaussian: Sigma = R S S^T R^T (Kerbl et al. 2023, eq. 6)."""

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.rotations import matrix_from_quats


def scaled_axes(log_scales: jax.Array, quats: jax.Array) -> jax.Array:
    """The principal semi-axes as columns: M = R S with Sigma = M M^T. (..., 3), (..., 4) -> (..., 3, 3)."""
    return matrix_from_quats(quats) * jnp.exp(log_scales)[..., None, :]
