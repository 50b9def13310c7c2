"""The refinement loop: Gaussians + views -> better Gaussians, and the curves that show it (paper Sec. 3.3)."""

from collections.abc import Iterator

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from rein3d_jax.errors import InputError
from rein3d_jax.rasterize import Buffers, RasterizeConfig, rasterize
from rein3d_jax.refine.config import RefineConfig
from rein3d_jax.refine.densify import densify, reset_opacity
from rein3d_jax.refine.relocate import relocate
from rein3d_jax.refine.snapshot import Snapshot
from rein3d_jax.refine.step import Chance, take_step
from rein3d_jax.refine.views import Views, camera_of

_GROW = {"default": densify, "mcmc": relocate}
ALL_STEPS, PLATEAU = "all steps taken", "held-out views stopped improving"
NO_STEPS = "no steps were to be taken"


@struct.dataclass
class _Schedule:
    """What is drawn before the first step."""

    batches: np.ndarray  # (steps, batch) views of each step
    backdrops: jax.Array  # (steps, 3)
    densify_key: jax.Array
    noise_key: jax.Array


def refine(
    snapshot: Snapshot,
    views: Views | None,
    key: jax.Array,
    *,
    config: RefineConfig,
    raster: RasterizeConfig,
    take_step=take_step,
) -> Iterator[Snapshot]:
    """The snapshots after each held-out evaluation and each step, from `snapshot` (`first_snapshot`'s, or any that was
    saved) to the last, whose `stopped` says why it ended; without steps that one alone, not evaluated.

    `views` (m, ...): every `held_out_every`-th is never trained on. The same key gives the same bytes, also when it
    goes on from a snapshot. `take_step` takes a step: step.py's, or one that shares it out over devices. Raises
    InputError where no view is left to train on.
    """
    if config.steps == 0:
        yield snapshot.replace(stopped=NO_STEPS)
        return
    schedule = _schedule(key, views.rgb.shape[0], config)
    while snapshot.step < config.steps:
        if snapshot.step % config.evaluate_every == 0 and not snapshot.evaluated:
            snapshot = evaluate_held_out(snapshot, views, config=config, raster=raster)
            if _flat(snapshot.curves.psnr, config):
                yield snapshot.replace(stopped=PLATEAU)
                return
            yield snapshot
        snapshot = _advance(take_step, snapshot, views, schedule, config, raster)
        snapshot = _grown(snapshot, schedule.densify_key, config)
        if snapshot.step < config.steps:
            yield snapshot
    snapshot = evaluate_held_out(snapshot, views, config=config, raster=raster)
    yield snapshot.replace(stopped=ALL_STEPS)


def _schedule(key: jax.Array, total: int, config: RefineConfig) -> _Schedule:
    training = np.setdiff1d(np.arange(total), np.arange(0, total, config.views.held_out_every))
    if len(training) == 0:
        mend = "lower refine.views.held_out_every or raise explore.trajectories"
        raise InputError(f"refine: {total} view leaves none to train on; {mend}")
    order_key, densify_key, backdrop_key, noise_key = jax.random.split(key, 4)
    backdrops = jax.random.uniform(backdrop_key, (max(config.steps, 1), 3))
    return _Schedule(_batches(order_key, training, config), backdrops, densify_key, noise_key)


def _batches(key, training: np.ndarray, config: RefineConfig) -> np.ndarray:
    """(steps, batch) indices: the training views in a new order in each epoch."""
    epochs = -(-max(config.steps, 1) * config.batch // len(training))
    orders = [jax.random.permutation(k, len(training)) for k in jax.random.split(key, epochs)]
    return training[np.concatenate(orders)[: config.steps * config.batch].reshape(config.steps, config.batch)]


def _flat(evaluations: np.ndarray, config: RefineConfig) -> bool:
    """Whether each of the last `patience` evaluations brought less than `plateau` dB over the best before it."""
    if config.plateau <= 0 or len(evaluations) <= config.patience:
        return False
    best = np.maximum.accumulate(evaluations[:, 1])
    return bool(np.all(np.diff(best)[-config.patience :] < config.plateau))


def _buffers(snapshot: Snapshot) -> Buffers:
    return Buffers(*map(int, snapshot.buffers))


def _reallocated(snapshot: Snapshot, needed: jax.Array) -> Snapshot:
    """With buffers for what the rasterizer confessed to need, and a quarter more."""
    curves = snapshot.curves.replace(reallocated=snapshot.curves.reallocated + 1)
    return snapshot.replace(buffers=jnp.array(_buffers(snapshot).enlarged(needed, slack=1.25)), curves=curves)


def _advance(take_step, snapshot: Snapshot, views, schedule: _Schedule, config, raster) -> Snapshot:
    """A step further; taken again with larger buffers where the rasterizer overflowed."""
    number = snapshot.step
    chance = Chance(jnp.asarray(schedule.batches[number]), schedule.backdrops[number], schedule.noise_key)
    while True:
        buffers = _buffers(snapshot)
        state, metrics = take_step(snapshot.state, views, chance, config=config, raster=raster, buffers=buffers)
        if int(metrics["overflow"]) == 0:
            break
        snapshot = _reallocated(snapshot, metrics["needed"])
    curves = snapshot.curves
    loss = np.concatenate([curves.loss, [[number + 1, float(metrics["loss"])]]])
    curves = curves.replace(loss=loss, skipped=curves.skipped + int(metrics["skipped"]))
    return snapshot.replace(state=state, curves=curves)


def _grown(snapshot: Snapshot, key, config: RefineConfig) -> Snapshot:
    """After densification and opacity reset, where their step has come."""
    number, state, curves, chosen = snapshot.step, snapshot.state, snapshot.curves, config.densify
    if config.densification == "none" or not chosen.start <= number < chosen.stop:
        return snapshot
    if number % chosen.every == 0:
        state, counts = _GROW[config.densification](state, jax.random.fold_in(key, number), config=chosen)
        curves = curves.replace(overflow=curves.overflow + int(counts["overflow"]))
    if number % chosen.reset_every == 0 and config.densification == "default":
        state = reset_opacity(state)
    return snapshot.replace(state=state, curves=curves)


def evaluate_held_out(snapshot: Snapshot, views: Views, *, config: RefineConfig, raster: RasterizeConfig) -> Snapshot:
    """The snapshot with the PSNR of the held-out views, and the count, added to its curves; as it is where it has been
    evaluated already."""
    if snapshot.evaluated:
        return snapshot
    state, errors = snapshot.state, []
    scene = state.shown(state.parameters)
    for index in range(0, views.rgb.shape[0], config.views.held_out_every):
        while True:
            frame = rasterize(scene, camera_of(views, index), config=raster, buffers=_buffers(snapshot))
            if int(frame.overflow) == 0:
                break
            snapshot = _reallocated(snapshot, frame.needed)
        error = (jnp.clip(frame.rgb, 0, 1) - views.rgb[index]) ** 2
        known = views.weight[index] > 0
        errors.append(float(jnp.sum(error * known[..., None]) / jnp.maximum(3 * jnp.sum(known), 1)))
    psnr = -10 * np.log10(max(np.mean(errors), 1e-10))
    curves = snapshot.curves
    rows = {name: getattr(curves, name) for name in ("psnr", "count")}
    found = {"psnr": psnr, "count": float(state.alive.sum() + state.still.scene.alive.sum())}
    added = {name: np.concatenate([rows[name], [[snapshot.step, value]]]) for name, value in found.items()}
    return snapshot.replace(curves=curves.replace(**added))
