"""Everything that a step changes, and its start."""

from functools import partial

import jax
import jax.numpy as jnp
import optax
from flax import struct

from rein3d_jax.refine.config import RefineConfig
from rein3d_jax.refine.parameters import join_parameters, make_optimizer, split_parameters, with_sh_degree
from rein3d_jax.scene import Gaussians


@struct.dataclass
class Still:
    """What nothing changes: rendered with the rest, it has no gradient and nothing that the optimizer remembers."""

    scene: Gaussians  # (m,)
    shown: Gaussians  # (k,) in its place while steps are taken: itself, or lighter where it is finer than the views


@struct.dataclass
class RefineState:
    """The scene, what of it may change in buffers of n slots, and what the optimizer remembers."""

    parameters: dict[str, jax.Array]
    alive: jax.Array  # (n,) bool
    floor: jax.Array  # (n,) least log scale, log metres
    still: Still
    extent: jax.Array  # () metres, the scene's size: what the means' rate and sizes are measured in
    optimizer: optax.OptState
    step: jax.Array  # ()
    gradient_sum: jax.Array  # (n,) means2d gradient since the last densification, in half image widths
    seen: jax.Array  # (n,) views that gave it one

    @property
    def scene(self) -> Gaussians:
        """All of it (n + m,): what is optimised, then what stays as it is."""
        return _one(join_parameters(self.parameters, self.alive), self.still.scene)

    def shown(self, parameters: dict[str, jax.Array]) -> Gaussians:
        """What views are compared with (n + k,), with other parameters in place of these."""
        return _one(join_parameters(parameters, self.alive), self.still.shown)


@jax.jit
def _one(*scenes: Gaussians) -> Gaussians:
    return jax.tree.map(lambda *x: jnp.concatenate(x), *scenes)


@partial(jax.jit, static_argnums=1)
def initial_state(
    gaussians: Gaussians, config: RefineConfig, *, extent: float, still: Still | None = None
) -> RefineState:
    """A fresh optimizer over `gaussians`; all get harmonics of the config's degree."""
    none = jax.tree.map(lambda x: x[:0], gaussians)
    parts = (gaussians, none, none) if still is None else (gaussians, still.scene, still.shown)
    gaussians, *of_still = (with_sh_degree(scene, config.sh_degree) for scene in parts)
    still = Still(*of_still)
    parameters = split_parameters(gaussians)
    pull, seen = (jnp.zeros(gaussians.alive.shape[0]) for _ in range(2))  # two buffers: each may be donated
    floor = jnp.min(gaussians.log_scales, axis=-1) + jnp.log(jnp.maximum(config.min_scale, 1e-6))
    optimizer = make_optimizer(config).init(parameters)
    step = jnp.zeros((), jnp.int32)
    return RefineState(parameters, gaussians.alive, floor, still, jnp.float32(extent), optimizer, step, pull, seen)
