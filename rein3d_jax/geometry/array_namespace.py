"""Formulas written once for JAX arrays and for NumPy's, which keep their own precision."""

from types import ModuleType

import jax
import jax.numpy as jnp
import numpy as np


def array_namespace(array: jax.Array | np.ndarray | float) -> ModuleType:
    """jax.numpy for a JAX array, traced or not; numpy for anything else."""
    return jnp if isinstance(array, jax.Array) else np
