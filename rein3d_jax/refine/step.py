"""Optimisation steps: state, views -> state, metrics. Pure. Sums over views stand apart from the update that follows:
devices add up theirs in between."""

from functools import partial

import jax
import jax.numpy as jnp
import optax
from flax import struct

from rein3d_jax.rasterize import Buffers, RasterizeConfig, rasterize
from rein3d_jax.refine.config import RefineConfig
from rein3d_jax.refine.losses import photometric_loss
from rein3d_jax.refine.parameters import make_optimizer
from rein3d_jax.refine.relocate import wander
from rein3d_jax.refine.state import RefineState
from rein3d_jax.refine.views import Views, camera_of


@struct.dataclass
class Chance:
    """What a step draws at random."""

    batch: jax.Array  # (b,) the views that it takes
    backdrop: jax.Array  # (3,) the colour behind the scene: drawn anew for each step it leaves transparency no colour
    # to imitate, so surfaces that should be solid become so
    key: jax.Array  # of mcmc's noise; the step's number is folded in


@struct.dataclass
class Sums:
    """Sums over the views of a batch, or of a device's share of it."""

    gradients: dict  # of the parameters
    pull: jax.Array  # (n,) norms of the means2d gradients, in half images
    seen: jax.Array  # (n,) views in which a Gaussian pulls
    loss: jax.Array  # ()
    views: jax.Array  # () how many
    excess: jax.Array  # (4,) by how much the rasterizer's buffers were too small
    overflow: jax.Array  # () what they dropped


def _visible_degrees(gradients, step, config):
    """Harmonics of degree d learn from step d * sh_degree_every on (3DGS)."""
    if config.sh_degree == 0:
        return gradients
    degree = jnp.concatenate([jnp.full(2 * d + 1, d) for d in range(1, config.sh_degree + 1)])
    active = degree * config.sh_degree_every <= step
    return gradients | {"sh_rest": gradients["sh_rest"] * active[:, None]}


def _mean(values, alive):
    return jnp.sum(jnp.where(alive, values, 0.0)) / jnp.maximum(jnp.sum(alive), 1)


def batch_sums(
    state: RefineState,
    views: Views,
    backdrop: jax.Array,
    *,
    config: RefineConfig,
    raster: RasterizeConfig,
    buffers: Buffers,
) -> tuple[Sums, jax.Array]:
    """The sums over the views, and the buffer sizes (4,) that they needed."""
    size, weight = views.rgb.shape[1], config.loss

    def loss(parameters, offset, view):
        """Of a single view (leading axis 1), and the sizes of buffers: needed, overflow."""
        gaussians = state.shown(parameters)
        offset = jnp.pad(offset, ((0, len(gaussians.alive) - len(offset)), (0, 0)))
        frame = rasterize(gaussians, camera_of(view, 0), config=raster, buffers=buffers, means2d_offset=offset)
        image = frame.rgb + (1 - frame.alpha[..., None]) * backdrop
        value = photometric_loss(image, view.rgb[0], view.weight[0], ssim_weight=weight.ssim)
        if weight.opacity > 0:
            value += weight.opacity * _mean(jax.nn.sigmoid(gaussians.opacity_logits), gaussians.alive)
        if weight.scale > 0:
            size_of_one = jnp.mean(jnp.exp(gaussians.log_scales), -1)
            value += weight.scale * _mean(size_of_one, gaussians.alive) / state.extent
        return value, (frame.needed, frame.overflow)

    def one_view(total, view):
        view = jax.tree.map(lambda x: x[None], view)
        offset = jnp.zeros((state.alive.shape[0], 2))
        gradient = jax.value_and_grad(loss, argnums=(0, 1), has_aux=True)
        (value, sizes), (of_parameters, of_means2d) = gradient(state.parameters, offset, view)
        pull = jnp.linalg.norm(of_means2d, axis=-1) * size / 2
        seen = (pull > 0).astype(jnp.float32)
        return jax.tree.map(jnp.add, total, (of_parameters, pull, seen, value)), sizes

    zeros = jnp.zeros_like(state.gradient_sum)
    nothing = jax.tree.map(jnp.zeros_like, state.parameters)
    sums, (needed, overflow) = jax.lax.scan(one_view, (nothing, zeros, zeros, jnp.zeros(())), views)
    needed, overflow = needed.max(axis=0), overflow.sum()
    excess = jnp.maximum(needed - jnp.array(buffers), 0)
    return Sums(*sums, jnp.float32(views.rgb.shape[0]), excess, overflow), needed


def update(
    state: RefineState, sums: Sums, needed: jax.Array, chance: Chance, *, config: RefineConfig, buffers: Buffers
) -> tuple[RefineState, dict]:
    """Returns (state, metrics); metrics: loss, overflow and needed of the rasterizer, skipped.

    The means' rate is scaled by the extent (3DGS), so the result does not depend on the unit of length. A step whose
    gradient is not finite changes nothing and is counted as skipped. Where devices share the views, `sums` are those of
    all, and `needed` is one's own: what comes out is then no less than any of them needs.
    """
    gradients = jax.tree.map(lambda x: x / sums.views, sums.gradients)
    gradients = _visible_degrees(gradients, state.step, config)
    finite = jnp.all(jnp.stack([jnp.all(jnp.isfinite(x)) for x in jax.tree.leaves(gradients)]))

    updates, optimizer = make_optimizer(config).update(gradients, state.optimizer, state.parameters)
    updates = updates | {"means": updates["means"] * state.extent}
    if config.densification == "mcmc":
        updates["means"] += wander(state, jax.random.fold_in(chance.key, state.step), config=config)
    parameters = optax.apply_updates(state.parameters, updates)
    parameters["log_scales"] = jnp.maximum(parameters["log_scales"], state.floor[:, None])
    moved = {
        "parameters": parameters,
        "optimizer": optimizer,
        "gradient_sum": state.gradient_sum + sums.pull,
        "seen": state.seen + sums.seen,
    }
    # The rest is passed on as it came: what stays still is not even copied.
    before = {name: getattr(state, name) for name in moved}
    new = jax.tree.map(lambda a, b: jnp.where(finite, a, b), moved, before)
    needed = jnp.where(sums.excess > 0, jnp.array(buffers) + sums.excess, needed)
    metrics = {"loss": sums.loss / sums.views, "needed": needed, "overflow": sums.overflow, "skipped": ~finite}
    return state.replace(**new, step=state.step + 1), metrics


@partial(jax.jit, static_argnames=("config", "raster", "buffers"))
def take_step(state, views, chance: Chance, *, config: RefineConfig, raster: RasterizeConfig, buffers: Buffers):
    """The `update` by the views that `chance.batch` names."""
    chosen = jax.tree.map(lambda x: x[chance.batch], views)
    sums, needed = batch_sums(state, chosen, chance.backdrop, config=config, raster=raster, buffers=buffers)
    return update(state, sums, needed, chance, config=config, buffers=buffers)
