"""One optimisation step: state, views -> state, metrics. Pure."""

import jax
import jax.numpy as jnp
import optax
from flax import struct

from rein3d_jax.rasterize import RasterizeConfig, rasterize
from rein3d_jax.refine.config import RefineConfig
from rein3d_jax.refine.losses import photometric_loss
from rein3d_jax.refine.parameters import join_parameters, make_optimizer, split_parameters
from rein3d_jax.refine.views import Views, camera_of
from rein3d_jax.scene import Gaussians


@struct.dataclass
class RefineState:
    """Everything that a step changes."""

    parameters: dict[str, jax.Array]
    alive: jax.Array  # (n,) bool
    floor: jax.Array  # (n,) least log scale, log metres
    optimizer: optax.OptState
    step: jax.Array  # ()
    gradient_sum: jax.Array  # (n,) 2D positional gradient since the last densification, in half image widths
    seen: jax.Array  # (n,) views that gave it one


def initial_state(gaussians: Gaussians, config: RefineConfig) -> RefineState:
    """A fresh optimizer over `gaussians`, whose harmonics have the config's degree."""
    parameters = split_parameters(gaussians)
    count = gaussians.alive.shape[0]
    zeros = jnp.zeros(count)
    optimizer = make_optimizer(config).init(parameters)
    floor = jnp.min(gaussians.log_scales, axis=-1) + jnp.log(jnp.maximum(config.finest, 1e-6))
    return RefineState(parameters, gaussians.alive, floor, optimizer, jnp.zeros((), jnp.int32), zeros, zeros)


def _visible_degrees(gradients, step, config):
    """Harmonics of degree d learn from step d * sh_degree_every on (3DGS)."""
    if config.sh_degree == 0:
        return gradients
    degree = jnp.concatenate([jnp.full(2 * d + 1, d) for d in range(1, config.sh_degree + 1)])
    active = degree * config.sh_degree_every <= step
    return gradients | {"sh_rest": gradients["sh_rest"] * active[:, None]}


def _step(
    state: RefineState,
    views: Views,
    extent: jax.Array,
    backdrop: jax.Array,
    *,
    config: RefineConfig,
    raster: RasterizeConfig,
):
    """Returns (state, metrics); metrics: loss, overflow and needed of the rasterizer, skipped.

    `views` are the batch; `extent` () scales the means' rate (3DGS), so the result does not depend on the unit
    of length. `backdrop` (3,) is the colour behind the scene: drawn anew for each step it leaves transparency no
    colour to imitate, so surfaces that should be solid become so. A step whose gradient is not finite changes
    nothing and is counted as skipped.
    """
    size = views.rgb.shape[1]

    def loss(parameters, probe, index):
        gaussians = join_parameters(parameters, state.alive)
        frame = rasterize(gaussians, camera_of(views, index), config=raster, probe=probe)
        image = frame.rgb + (1 - frame.alpha[..., None]) * backdrop
        value = photometric_loss(image, views.rgb[index], views.weight[index], ssim_weight=config.ssim_weight)
        return value, (frame.needed, frame.overflow)

    def one_view(total, index):
        probe = jnp.zeros((state.alive.shape[0], 2))
        gradient = jax.value_and_grad(loss, argnums=(0, 1), has_aux=True)
        (value, buffers), (of_parameters, of_probe) = gradient(state.parameters, probe, index)
        pull = jnp.linalg.norm(of_probe, axis=-1) * size / 2
        total = jax.tree.map(jnp.add, total, (of_parameters, pull, (pull > 0).astype(jnp.float32), value))
        return total, buffers

    count = views.rgb.shape[0]
    zeros = jnp.zeros_like(state.gradient_sum)
    start = (jax.tree.map(jnp.zeros_like, state.parameters), zeros, zeros, jnp.zeros(()))
    (gradients, pull, seen, value), (needed, overflow) = jax.lax.scan(one_view, start, jnp.arange(count))
    gradients = jax.tree.map(lambda x: x / count, gradients)
    gradients = _visible_degrees(gradients, state.step, config)
    finite = jnp.all(jnp.stack([jnp.all(jnp.isfinite(x)) for x in jax.tree.leaves(gradients)]))

    updates, optimizer = make_optimizer(config).update(gradients, state.optimizer, state.parameters)
    updates = updates | {"means": updates["means"] * extent}
    parameters = optax.apply_updates(state.parameters, updates)
    parameters["log_scales"] = jnp.maximum(parameters["log_scales"], state.floor[:, None])
    moved = state.replace(
        parameters=parameters,
        optimizer=optimizer,
        gradient_sum=state.gradient_sum + pull,
        seen=state.seen + seen,
    )
    new = jax.tree.map(lambda a, b: jnp.where(finite, a, b), moved, state)
    metrics = {"loss": value / count, "needed": needed.max(axis=0), "overflow": overflow.sum(), "skipped": ~finite}
    return new.replace(step=state.step + 1), metrics


step = jax.jit(_step, static_argnames=("config", "raster"))
