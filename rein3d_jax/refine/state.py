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
    """The scene in buffers of n slots, k sources of views, and what the optimizer remembers."""

    parameters: dict[str, jax.Array]
    alive: jax.Array  # (n,) bool
    floor: jax.Array  # (n,) least log scale, log metres
    fixed: jax.Array  # (n,) bool, stays as it is; no free slot is
    optimizer: optax.OptState
    colour: jax.Array  # (k, 3, 4) affine from the scene's colour to each source's; the input's, 0, stays the identity
    colour_optimizer: optax.OptState
    step: jax.Array  # ()
    gradient_sum: jax.Array  # (n,) 2D positional gradient since the last densification, in half image widths
    seen: jax.Array  # (n,) views that gave it one


def initial_state(gaussians: Gaussians, config: RefineConfig, *, sources: int = 1, fixed=None) -> RefineState:
    """A fresh optimizer over `gaussians`, whose harmonics have the config's degree, and `sources` of views. `fixed`,
    (n,) bool or None, are the Gaussians that nothing may change."""
    parameters = split_parameters(gaussians)
    zeros = jnp.zeros(gaussians.alive.shape[0])
    floor = jnp.min(gaussians.log_scales, axis=-1) + jnp.log(jnp.maximum(config.finest, 1e-6))
    fixed = jnp.zeros_like(gaussians.alive) if fixed is None else fixed & gaussians.alive
    colour = jnp.broadcast_to(jnp.eye(3, 4), (sources, 3, 4))
    return RefineState(
        parameters, gaussians.alive, floor, fixed, make_optimizer(config).init(parameters),
        colour, optax.adam(config.colour_rate).init(colour), jnp.zeros((), jnp.int32), zeros, zeros,
    )  # fmt: skip
