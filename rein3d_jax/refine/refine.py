"""The refinement loop: Gaussians + views -> better Gaussians, and the curves that show it."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from rein3d_jax.errors import InputError
from rein3d_jax.rasterize import RasterizeConfig, allocate, enlarge, rasterize
from rein3d_jax.refine.config import RefineConfig
from rein3d_jax.refine.densify import densify, reset_opacity
from rein3d_jax.refine.parameters import join_parameters, with_sh_degree
from rein3d_jax.refine.relocate import relocate
from rein3d_jax.refine.state import RefineState, initial_state
from rein3d_jax.refine.step import steps
from rein3d_jax.refine.views import Views, camera_of
from rein3d_jax.scene import Gaussians

GROW = {"default": densify, "mcmc": relocate}
CURVES = ("loss", "psnr", "count", "overflow", "reallocated", "skipped", "stopped")
STOPPED = ("all steps taken", "held-out views stopped improving", "the budget's seconds were spent")


@struct.dataclass
class Snapshot:
    """The loop between two steps: enough to go on to the same bytes."""

    state: RefineState
    buffers: jax.Array  # (4,) the rasterizer's: sums over buffers of another size round otherwise
    curves: dict[str, np.ndarray]  # as `refine` returns them


def blank_snapshot(config: RefineConfig) -> Snapshot:
    """A snapshot's structure and dtypes, with which to read one back."""
    one, sh = jnp.ones(1), jnp.zeros((1, 1, 3))
    scene = Gaussians(jnp.zeros((1, 3)), jnp.zeros((1, 3)), jnp.eye(1, 4), one, sh, one > 0)
    state = initial_state(with_sh_degree(scene, config.sh_degree), config)
    return Snapshot(state, jnp.zeros(4, jnp.int32), {name: np.zeros(0) for name in CURVES})


def refine(
    gaussians: Gaussians,
    views: Views,
    extent: float,
    key: jax.Array,
    *,
    config: RefineConfig,
    raster: RasterizeConfig,
    on_step: Callable[[int], None] = lambda step: None,
    start: Snapshot | None = None,
    on_look: Callable[[Snapshot], None] = lambda snapshot: None,
    enough: Callable[[], bool] = lambda: False,
    run: Callable = steps,
    fixed: jax.Array | None = None,
) -> tuple[Gaussians, dict[str, np.ndarray]]:
    """Fit `gaussians` to `views` for `config.steps` steps; every `test_every`-th view is only looked at.

    Returns the scene and curves: `loss` (k, 2) of (step, value), `psnr` (k, 2) of (step, held-out dB), `count` (k, 2)
    of (step, Gaussians), and the totals `overflow` (Gaussians that densification had no slot for), `reallocated`,
    `skipped`, and `stopped`, the index in STOPPED of why it ended. `extent` is the scene's size in metres. The same
    key gives the same bytes, also when it goes on from the `start` that `on_look` was given. It ends early where
    `enough()`. `run` takes the steps: `step.steps`, or one that shares them out over devices. `fixed` (n,) bool are the
    Gaussians that stay as they are. Raises InputError where no view is left to train on.
    """
    total = views.rgb.shape[0]
    held_out = np.arange(0, total, config.test_every)
    training = np.setdiff1d(np.arange(total), held_out)
    if len(training) == 0:
        raise InputError(f"refine: {total} view leaves none to train on; lower refine.test_every or add trajectories")
    if start is None:
        sources = int(jnp.max(views.source)) + 1
        state = initial_state(with_sh_degree(gaussians, config.sh_degree), config, sources=sources, fixed=fixed)
        curves = {name: np.zeros((0, 2) if name in CURVES[:3] else ()) for name in CURVES}
        raster = _allocate(state, views, raster)
    else:
        state, curves = start.state, start.curves
        raster = enlarge(raster, *(int(x) for x in start.buffers))
    order_key, densify_key, backdrop_key, noise_key = jax.random.split(key, 4)
    backdrops = jax.random.uniform(backdrop_key, (max(config.steps, 1), 3))
    batches = _batches(order_key, training, config)
    while (number := int(state.step)) < config.steps:
        if enough():
            curves = curves | {"stopped": np.full((), 2.0)}
            break
        if number % config.evaluate_every == 0 and (start is None or number > int(start.state.step)):
            raster, curves = _look(state, views, held_out, raster, curves)
            if _flat(curves["psnr"], config):
                return join_parameters(state.parameters, state.alive), curves | {"stopped": np.ones(())}
            on_look(Snapshot(state, jnp.array(raster.buffers), curves))
        some = slice(number, _until(number, config))
        arguments = (views, jnp.asarray(batches[some]), backdrops[some], extent, noise_key)
        state, raster, curves = _advance(run, state, arguments, config, raster, curves)
        state, curves = _between(state, extent, densify_key, config, curves)
        on_step(int(state.step))
    _, curves = _look(state, views, held_out, raster, curves)
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


def _until(number: int, config: RefineConfig) -> int:
    """The step to which `steps_at_once` may go: nothing but steps may lie between."""
    periods = (config.evaluate_every, config.densify_every, config.reset_every)
    return min(number + config.steps_at_once, config.steps, *((number // every + 1) * every for every in periods))


def _flat(looks: np.ndarray, config: RefineConfig) -> bool:
    """Whether each of the last `patience` looks brought less than `plateau` dB over the best before it."""
    if config.plateau <= 0 or len(looks) <= config.patience:
        return False
    best = np.maximum.accumulate(looks[:, 1])
    return bool(np.all(np.diff(best)[-config.patience :] < config.plateau))


def _grow(raster: RasterizeConfig, needed: jax.Array, curves: dict) -> tuple[RasterizeConfig, dict]:
    grown = enlarge(raster, *(int(x * 1.25) for x in needed))
    return grown, curves | {"reallocated": curves["reallocated"] + 1}


def _advance(run, state, arguments, config, raster, curves):
    """Some steps, taken again with larger buffers where the rasterizer confessed an overflow."""
    while True:
        new, metrics = run(state, *arguments, config=config, raster=raster)
        if int(jnp.sum(metrics["overflow"])) == 0:
            break
        raster, curves = _grow(raster, jnp.max(metrics["needed"], axis=0), curves)
    numbers = np.arange(int(state.step), int(new.step)) + 1
    losses = np.stack([numbers, np.asarray(metrics["loss"])], axis=-1)
    skipped = curves["skipped"] + np.sum(np.asarray(metrics["skipped"]))
    return new, raster, curves | {"loss": np.concatenate([curves["loss"], losses]), "skipped": skipped}


def _between(state: RefineState, extent, key, config: RefineConfig, curves: dict):
    """Densification and opacity reset, when their step has come."""
    number = int(state.step)
    growing = config.densify_start <= number < config.densify_stop
    if growing and number % config.densify_every == 0:
        state, counts = GROW[config.densification](state, extent, jax.random.fold_in(key, number), config=config)
        curves = curves | {"overflow": curves["overflow"] + int(counts["overflow"])}
    if growing and number % config.reset_every == 0 and config.densification == "default":
        state = reset_opacity(state)
    return state, curves


def _look(state, views, held_out, raster, curves):
    """Append the held-out PSNR and the count to the curves."""
    gaussians = join_parameters(state.parameters, state.alive)
    errors = []
    for index in held_out:
        while True:
            frame = rasterize(gaussians, camera_of(views, int(index)), config=raster)
            if int(frame.overflow) == 0:
                break
            raster, curves = _grow(raster, frame.needed, curves)
        error = (jnp.clip(frame.rgb, 0, 1) - views.rgb[index]) ** 2
        known = views.weight[index] > 0
        errors.append(float(jnp.sum(error * known[..., None]) / jnp.maximum(3 * jnp.sum(known), 1)))
    found = {"psnr": -10 * np.log10(max(np.mean(errors), 1e-10)), "count": float(state.alive.sum())}
    added = {name: np.concatenate([curves[name], [[int(state.step), x]]]) for name, x in found.items()}
    return raster, curves | added
