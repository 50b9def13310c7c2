"""Functions whose value AND gradient stay finite at their singular point."""

import jax
import jax.numpy as jnp
import numpy as np

from rein3d_jax.geometry.array_namespace import array_namespace


def safe_norm(x: jax.Array | np.ndarray, *, axis: int = -1, keepdims: bool = False) -> jax.Array | np.ndarray:
    """The Euclidean norm, with gradient 0 (not NaN) at x = 0."""
    xp = array_namespace(x)
    squared = xp.sum(x * x, axis=axis, keepdims=keepdims)
    positive = squared > 0
    return xp.where(positive, xp.sqrt(xp.where(positive, squared, 1.0)), 0.0)


def safe_divide(numerator: jax.Array, denominator: jax.Array, *, otherwise: float = 0.0) -> jax.Array:
    """The quotient, and `otherwise` with gradient 0 where the denominator is 0."""
    zero = denominator == 0
    return jnp.where(zero, otherwise, numerator / jnp.where(zero, 1.0, denominator))
