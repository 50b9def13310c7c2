"""Optimisation steps: state, views -> state, metrics. Pure."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import optax

from rein3d_jax.rasterize import RasterizeConfig, rasterize
from rein3d_jax.refine.config import RefineConfig
from rein3d_jax.refine.losses import distance_loss, photometric_loss
from rein3d_jax.refine.parameters import join_parameters, make_optimizer
from rein3d_jax.refine.relocate import explore
from rein3d_jax.refine.state import RefineState
from rein3d_jax.refine.views import Views, camera_of


def _visible_degrees(gradients, step, config):
    """Harmonics of degree d learn from step d * sh_degree_every on (3DGS)."""
    if config.sh_degree == 0:
        return gradients
    degree = jnp.concatenate([jnp.full(2 * d + 1, d) for d in range(1, config.sh_degree + 1)])
    active = degree * config.sh_degree_every <= step
    return gradients | {"sh_rest": gradients["sh_rest"] * active[:, None]}


def _loss(parameters, probe, colour, state, view: Views, extent, backdrop, config, raster):
    """Loss of a single view (leading axis 1), and the rasterizer's buffers: needed, overflow."""
    gaussians = join_parameters(parameters, state.alive)
    probes = {"strain" if config.absolute_gradient else "probe": probe}
    frame = rasterize(gaussians, camera_of(view, 0), config=raster, **probes)
    rgb = _tinted(frame, colour[view.source[0]]) if config.colour_rate > 0 else frame.rgb
    image = rgb + (1 - frame.alpha[..., None]) * backdrop
    value = photometric_loss(image, view.rgb[0], view.weight[0], ssim_weight=config.ssim_weight)
    if config.distance_weight > 0:
        value += config.distance_weight * distance_loss(frame.distance, view.distance[0])
    if config.opacity_weight > 0:
        value += config.opacity_weight * _mean(jax.nn.sigmoid(parameters["opacity_logits"]), state.alive)
    if config.scale_weight > 0:
        value += config.scale_weight * _mean(jnp.mean(jnp.exp(parameters["log_scales"]), -1), state.alive) / extent
    return value, (frame.needed, frame.overflow)


def _tinted(frame, affine):
    """Premultiplied colour after an affine (3, 4) of the colour itself."""
    turned = jnp.einsum("hwc,dc->hwd", frame.rgb, affine[:, :3], precision="highest")
    return turned + frame.alpha[..., None] * affine[:, 3]


def _unless(fixed, update):
    return jnp.where(fixed.reshape(-1, *[1] * (update.ndim - 1)), 0.0, update)


def _mean(values, alive):
    return jnp.sum(jnp.where(alive, values, 0.0)) / jnp.maximum(jnp.sum(alive), 1)


def _gradients(state, views: Views, extent, backdrop, config, raster):
    """Sums over the views: gradients of (parameters, colour), pull and views by slot, loss; then (needed, overflow)."""
    size = views.rgb.shape[1]

    def one_view(total, view):
        view = jax.tree.map(lambda x: x[None], view)
        probe = jnp.zeros(state.alive.shape if config.absolute_gradient else (state.alive.shape[0], 2))
        gradient = jax.value_and_grad(_loss, argnums=(0, 1, 2), has_aux=True)
        arguments = (state.parameters, probe, state.colour, state, view, extent, backdrop, config, raster)
        (value, buffers), (of_parameters, of_probe, of_colour) = gradient(*arguments)
        pull = (of_probe if config.absolute_gradient else jnp.linalg.norm(of_probe, axis=-1)) * size / 2
        seen = (pull > 0).astype(jnp.float32)
        return jax.tree.map(jnp.add, total, (of_parameters, of_colour, pull, seen, value)), buffers

    zeros = jnp.zeros_like(state.gradient_sum)
    nothing = jax.tree.map(jnp.zeros_like, (state.parameters, state.colour))
    sums, (needed, overflow) = jax.lax.scan(one_view, (*nothing, zeros, zeros, jnp.zeros(())), views)
    return sums, (needed.max(axis=0), overflow.sum())


def step(
    state: RefineState,
    views: Views,
    extent: jax.Array,
    backdrop: jax.Array,
    key: jax.Array,
    *,
    config: RefineConfig,
    raster: RasterizeConfig,
    total: Callable[[Any], Any] = lambda x: x,
):
    """Returns (state, metrics); metrics: loss, overflow and needed of the rasterizer, skipped.

    `views` are the batch; `extent` () scales the means' rate (3DGS), so the result does not depend on the unit
    of length. `backdrop` (3,) is the colour behind the scene: drawn anew for each step it leaves transparency no
    colour to imitate, so surfaces that should be solid become so. A step whose gradient is not finite changes
    nothing and is counted as skipped. Over several devices each sees its share of the views, and `total` sums over
    them (parallel/data_parallel.py); `needed` is then no less than any of them needs.
    """
    sums, (needed, overflow) = _gradients(state, views, extent, backdrop, config, raster)
    buffers = jnp.array(raster.buffers)
    excess = jnp.maximum(needed - buffers, 0)
    sums, count, excess, overflow = total((sums, jnp.float32(views.rgb.shape[0]), excess, overflow))
    of_parameters, of_colour, pull, seen, value = sums
    gradients, of_colour = jax.tree.map(lambda x: x / count, (of_parameters, of_colour))
    gradients = _visible_degrees(gradients, state.step, config)
    finite = jnp.all(jnp.stack([jnp.all(jnp.isfinite(x)) for x in jax.tree.leaves((gradients, of_colour))]))

    updates, optimizer = make_optimizer(config).update(gradients, state.optimizer, state.parameters)
    updates = updates | {"means": updates["means"] * extent}
    if config.densification == "mcmc":
        updates["means"] += explore(state, extent, jax.random.fold_in(key, state.step), config=config)
    updates = {name: _unless(state.fixed, update) for name, update in updates.items()}
    parameters = optax.apply_updates(state.parameters, updates)
    parameters["log_scales"] = jnp.maximum(parameters["log_scales"], state.floor[:, None])
    of_colour = of_colour.at[0].set(0.0)  # the input's colours are the scene's
    tint, colour_optimizer = optax.adam(config.colour_rate).update(of_colour, state.colour_optimizer)
    moved = state.replace(
        parameters=parameters,
        optimizer=optimizer,
        colour=state.colour + tint,
        colour_optimizer=colour_optimizer,
        gradient_sum=state.gradient_sum + pull,
        seen=state.seen + seen,
    )
    new = jax.tree.map(lambda a, b: jnp.where(finite, a, b), moved, state)
    needed = jnp.where(excess > 0, buffers + excess, needed)
    metrics = {"loss": value / count, "needed": needed, "overflow": overflow, "skipped": ~finite}
    return new.replace(step=state.step + 1), metrics


def _steps(state, views, batches, backdrops, extent, key, *, config, raster):
    def body(state, turn):
        batch, backdrop = turn
        chosen = jax.tree.map(lambda x: x[batch], views)
        return step(state, chosen, extent, backdrop, key, config=config, raster=raster)

    if len(batches) == 1:  # XLA's CPU backend runs several times slower inside a loop, be it of one turn
        state, metrics = body(state, (batches[0], backdrops[0]))
        return state, jax.tree.map(lambda x: x[None], metrics)
    return jax.lax.scan(body, state, (batches, backdrops))


steps = jax.jit(_steps, static_argnames=("config", "raster"))
steps.__doc__ = """`step` for each row of `batches` (k, batch), indices into `views`, with `backdrops` (k, 3): (state,
metrics with a leading axis k)."""
