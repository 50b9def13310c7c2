"""Train the learned restorer on what experiments.build_examples wrote.

Writes into the output folder: config.toml, checkpoints/ (the last and the best), log.jsonl and TensorBoard events,
samples/STEP.png (held-out clips: rendered, filled, restored, clean), and weights.npz, the best average so far.
"""

from pathlib import Path

import jax
import numpy as np
from jax.sharding import NamedSharding, PartitionSpec

from experiments.example_store import ExampleStore
from experiments.train_restore.config import TrainConfig
from experiments.train_restore.data import batch
from experiments.train_restore.guarded_step import TrainState
from experiments.train_restore.run import TrainingRun
from experiments.train_restore.step import initial_state, make_step
from rein3d_jax.errors import InputError
from rein3d_jax.io.files.training_checkpoint import TrainingCheckpoints
from rein3d_jax.parallel import data_mesh, data_parallel


def train(config: TrainConfig, *, resume: bool = False) -> TrainState:
    """Run to config.steps; returns the last state. Raises InputError for what is wrong with the input, and where the
    guard's patience ends."""
    output, store, mesh = Path(config.output), ExampleStore(config.data.folder), data_mesh(config.devices)
    _check(config, store, mesh.size)
    step = data_parallel(make_step(config), mesh, backend=config.backend, axis=1)
    with TrainingCheckpoints(output / "checkpoints") as checkpoints:
        # Laid over the mesh as the step returns it: another layout would compile the step a second time.
        state = jax.device_put(_first_state(config, checkpoints, resume), NamedSharding(mesh, PartitionSpec()))
        with TrainingRun(config, store, checkpoints, int(state.step)) as run:
            while run.step < config.steps:
                host, hosts = jax.process_index(), jax.process_count()
                state, metrics = step(state, batch(store, run.step, config, host=host, hosts=hosts))
                run.after(state, metrics)
    return state


def _check(config: TrainConfig, store: ExampleStore, devices: int) -> None:
    if config.batch // config.accumulate % devices:
        raise InputError(f"batch {config.batch} / accumulate {config.accumulate} does not divide by {devices} devices")
    if len(store) <= config.data.held_out:
        raise InputError(f"{store.folder} holds {len(store)} examples, and data.held_out takes {config.data.held_out}")


def _first_state(config: TrainConfig, checkpoints: TrainingCheckpoints, resume: bool) -> TrainState:
    last = checkpoints.last()
    if last is not None and not resume:
        raise InputError(f"{config.output} holds a run of {last} steps: --resume it, or choose another output")
    state = jax.tree.map(np.asarray, initial_state(config))  # NumPy's arrays may be laid over any devices
    return state if last is None else checkpoints.restore(last, state)
