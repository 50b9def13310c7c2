"""Everything that a step changes, and its start."""

import jax
import jax.numpy as jnp
import optax
from flax import struct

from rein3d_jax.refine.config import RefineConfig
from rein3d_jax.refine.parameters import make_optimizer, split_parameters
from rein3d_jax.scene import Gaussians


@struct.dataclass
class RefineState:
    """The scene in buffers of n slots, and what the optimizer remembers."""

    parameters: dict[str, jax.Array]
    alive: jax.Array  # (n,) bool
    floor: jax.Array  # (n,) least log scale, log metres
    fixed: jax.Array  # (n,) bool, stays as it is; no free slot is
    extent: jax.Array  # () metres, the scene's size: what the means' rate and sizes are measured in
    optimizer: optax.OptState
    step: jax.Array  # ()
    gradient_sum: jax.Array  # (n,) means2d gradient since the last densification, in half image widths
    seen: jax.Array  # (n,) views that gave it one


def initial_state(gaussians: Gaussians, config: RefineConfig, *, extent: float, fixed=None) -> RefineState:
    """A fresh optimizer over `gaussians`, whose harmonics have the config's degree. `fixed`, (n,) bool or None, are
    the Gaussians that nothing may change."""
    parameters = split_parameters(gaussians)
    pull, seen = (jnp.zeros(gaussians.alive.shape[0]) for _ in range(2))  # two buffers: each may be donated
    floor = jnp.min(gaussians.log_scales, axis=-1) + jnp.log(jnp.maximum(config.min_scale, 1e-6))
    fixed = jnp.zeros_like(gaussians.alive) if fixed is None else fixed & gaussians.alive
    optimizer = make_optimizer(config).init(parameters)
    step = jnp.zeros((), jnp.int32)
    return RefineState(parameters, gaussians.alive, floor, fixed, jnp.float32(extent), optimizer, step, pull, seen)
