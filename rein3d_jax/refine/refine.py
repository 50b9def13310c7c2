"""The refinement loop: Gaussians + views -> better Gaussians, and the curves that show it."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.rasterize import RasterizeConfig, allocate, enlarge, rasterize
from rein3d_jax.refine.config import RefineConfig
from rein3d_jax.refine.densify import densify, reset_opacity
from rein3d_jax.refine.parameters import join_parameters, with_sh_degree
from rein3d_jax.refine.step import RefineState, initial_state, step
from rein3d_jax.refine.views import Views, camera_of
from rein3d_jax.scene import Gaussians


def refine(
    gaussians: Gaussians,
    views: Views,
    extent: float,
    key: jax.Array,
    *,
    config: RefineConfig,
    raster: RasterizeConfig,
    on_step: Callable[[int], None] = lambda step: None,
) -> tuple[Gaussians, dict]:
    """Fit `gaussians` to `views` for `config.steps` steps; every `test_every`-th view is only looked at.

    Returns the scene and curves: `loss` [(step, value)], `psnr` [(step, held-out dB)], `count` [(step, Gaussians)],
    and the totals `overflow` (Gaussians that densification had no slot for), `reallocated`, `skipped`.
    `extent` is the scene's size in metres. The same key gives the same bytes.
    """
    total = views.rgb.shape[0]
    held_out = np.arange(0, total, config.test_every)
    training = np.setdiff1d(np.arange(total), held_out)
    if len(training) == 0:
        raise InputError(f"refine: {total} view leaves none to train on; lower refine.test_every or add trajectories")
    state = initial_state(with_sh_degree(gaussians, config.sh_degree), config)
    raster = _allocate(state, views, raster)
    order_key, densify_key, backdrop_key = jax.random.split(key, 3)
    backdrops = jax.random.uniform(backdrop_key, (max(config.steps, 1), 3))
    batches = _batches(order_key, training, config)
    curves = {"loss": [], "psnr": [], "count": [], "overflow": 0, "reallocated": 0, "skipped": 0}
    for number in range(config.steps):
        if number % config.evaluate_every == 0:
            raster = _look(state, views, held_out, raster, number, curves)
        batch = jax.tree.map(lambda x, b=batches[number]: x[b], views)
        state, raster = _advance(state, batch, extent, backdrops[number], config, raster, curves)
        state = _between(state, number + 1, extent, densify_key, config, curves)
        on_step(number + 1)
    _look(state, views, held_out, raster, config.steps, curves)
    return join_parameters(state.parameters, state.alive), curves


def _allocate(state: RefineState, views: Views, raster: RasterizeConfig) -> RasterizeConfig:
    """Buffers for a spread of at most 24 views; a greedier one grows them when it comes."""
    gaussians = join_parameters(state.parameters, state.alive)
    chosen = np.unique(np.linspace(0, views.rgb.shape[0] - 1, 24).astype(int))
    return allocate(gaussians, [camera_of(views, int(i)) for i in chosen], config=raster, slack=1.25)


def _batches(key, training: np.ndarray, config: RefineConfig) -> np.ndarray:
    """(steps, batch) indices: the training views in a new order each time round."""
    rounds = -(-max(config.steps, 1) * config.batch // len(training))
    orders = [jax.random.permutation(k, len(training)) for k in jax.random.split(key, rounds)]
    return training[np.concatenate(orders)[: config.steps * config.batch].reshape(config.steps, config.batch)]


def _grow(raster: RasterizeConfig, needed: jax.Array, curves: dict) -> RasterizeConfig:
    curves["reallocated"] += 1
    return enlarge(raster, *(int(x * 1.25) for x in needed))


def _advance(state, batch, extent, backdrop, config, raster, curves):
    """One step, taken again with larger buffers where the rasterizer confessed an overflow."""
    while True:
        new, metrics = step(state, batch, extent, backdrop, config=config, raster=raster)
        if int(metrics["overflow"]) == 0:
            break
        raster = _grow(raster, metrics["needed"], curves)
    curves["loss"].append((int(new.step), float(metrics["loss"])))
    curves["skipped"] += int(metrics["skipped"])
    return new, raster


def _between(state: RefineState, number: int, extent, key, config: RefineConfig, curves: dict) -> RefineState:
    """Densification and opacity reset, when their step has come."""
    growing = config.densify_start <= number < config.densify_stop
    if growing and number % config.densify_every == 0:
        state, counts = densify(state, extent, jax.random.fold_in(key, number), config=config)
        curves["overflow"] += int(counts["overflow"])
    if growing and number % config.reset_every == 0:
        state = reset_opacity(state)
    return state


def _look(state, views, held_out, raster, number, curves):
    """Append the held-out PSNR and the count to the curves."""
    gaussians = join_parameters(state.parameters, state.alive)
    errors = []
    for index in held_out:
        while True:
            frame = rasterize(gaussians, camera_of(views, int(index)), config=raster)
            if int(frame.overflow) == 0:
                break
            raster = _grow(raster, frame.needed, curves)
        error = (jnp.clip(frame.rgb, 0, 1) - views.rgb[index]) ** 2
        known = views.weight[index] > 0
        errors.append(float(jnp.sum(error * known[..., None]) / jnp.maximum(3 * jnp.sum(known), 1)))
    curves["psnr"].append((number, float(-10 * np.log10(max(np.mean(errors), 1e-10)))))
    curves["count"].append((number, int(state.alive.sum())))
    return raster
