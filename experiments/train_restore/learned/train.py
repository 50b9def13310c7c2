"""Train the learned restorer on what experiments.build_examples wrote.

Writes into the output folder: config.toml, checkpoints/ (the last and the best), log.jsonl and TensorBoard events,
samples/STEP.png (held-out clips: rendered, filled, restored, clean), and weights.npz, the best average so far.
"""

from pathlib import Path

import jax
import numpy as np
from jax.sharding import NamedSharding, PartitionSpec

from experiments.example_store import ExampleStore
from experiments.train_restore.guarded_step import TrainState
from experiments.train_restore.learned.config import LearnedTrainConfig
from experiments.train_restore.learned.data import example_batch
from experiments.train_restore.learned.run import LearnedRun
from experiments.train_restore.learned.step import initial_learned_state, make_learned_step
from experiments.train_restore.run import clips_per_device, last_step
from rein3d_jax.errors import InputError
from rein3d_jax.io.files.training_checkpoint import TrainingCheckpoints
from rein3d_jax.parallel import data_mesh, data_parallel


def train_learned(config: LearnedTrainConfig, *, resume: bool = False) -> TrainState:
    """Last state of a run to config.steps. Raises InputError for what is wrong with the input, and where the
    guard's patience ends."""
    output, store, mesh = Path(config.output), ExampleStore(config.data.folder), data_mesh(config.devices)
    _check(config, store, mesh.size)
    step = data_parallel(make_learned_step(config), mesh, backend=config.backend, axis=1)
    with TrainingCheckpoints(output / "checkpoints") as checkpoints:
        # Laid over the mesh as the step returns it: another layout would compile the step a second time.
        state = jax.device_put(_first_state(config, checkpoints, resume), NamedSharding(mesh, PartitionSpec()))
        with LearnedRun(config, store, checkpoints, int(state.step)) as run:
            while run.step < config.steps:
                host, hosts = jax.process_index(), jax.process_count()
                state, metrics = step(state, example_batch(store, run.step, config, host=host, hosts=hosts))
                run.after(state, metrics)
    return state


def _check(config: LearnedTrainConfig, store: ExampleStore, devices: int) -> None:
    clips_per_device(config, devices)
    if len(store) <= config.data.held_out:
        raise InputError(f"{store.folder} holds {len(store)} examples, and data.held_out takes {config.data.held_out}")


def _first_state(config: LearnedTrainConfig, checkpoints: TrainingCheckpoints, resume: bool) -> TrainState:
    last = last_step(config, checkpoints, resume)
    state = jax.tree.map(np.asarray, initial_learned_state(config))  # NumPy's arrays may be laid over any devices
    return state if last is None else checkpoints.restore(last, state)
