"""Train the full-size restoration network (Wan2.1-VACE) on pairs of clips.

Writes into the output folder: config.toml, checkpoints/ (the last and the best), log.jsonl and TensorBoard events,
samples/STEP.png (a held-out clip: rendered, restored, clean), and weights/, the best average so far, a folder that
restore.weights takes.
"""

from pathlib import Path

import jax
import numpy as np
from jax.sharding import NamedSharding, PartitionSpec

from experiments.machine import machine_bytes
from experiments.train_restore.run import clips_per_device, last_step
from experiments.train_restore.wan.config import WanTrainConfig
from experiments.train_restore.wan.data import open_pairs, pair_batches
from experiments.train_restore.wan.run import WanRun
from experiments.train_restore.wan.step import WanState, initial_wan_state, make_wan_step
from rein3d_jax.io.files.training_checkpoint import TrainingCheckpoints
from rein3d_jax.io.pairs.pair_shard import PairDataset
from rein3d_jax.networks.wan import random_wan, read_wan
from rein3d_jax.parallel import data_mesh, data_parallel, state_shardings
from rein3d_jax.restore.wan.training.memory import GIB, Workload, require_fit


def train_wan(config: WanTrainConfig, *, resume: bool = False) -> WanState:
    """Last state of a run to config.steps. Raises InputError for what is wrong with the input, for what no
    device can hold, and where the guard's patience ends."""
    pairs, mesh = open_pairs(config), data_mesh(config.devices)
    _check(config, pairs, mesh.size)
    step = data_parallel(make_wan_step(config), mesh, backend=config.backend, axis=1, sharded=config.sharded)
    with TrainingCheckpoints(Path(config.output) / "checkpoints") as checkpoints:
        state = _first_state(config, checkpoints, resume)
        # Laid over the mesh as the step returns it: another layout would compile the step a second time.
        layout = state_shardings(mesh, state) if config.sharded else NamedSharding(mesh, PartitionSpec())
        state = jax.device_put(state, layout)
        host, hosts = jax.process_index(), jax.process_count()
        with WanRun(config, pairs, checkpoints, int(state.train.step)) as run:
            for batch in pair_batches(pairs, run.step, config, host=host, hosts=hosts):
                state, metrics = step(state, batch)
                run.after(state, metrics)
    return state


def _check(config: WanTrainConfig, pairs: PairDataset, devices: int) -> None:
    """Prints what the run needs of each device's memory."""
    clips, shards = clips_per_device(config, devices), devices if config.sharded else 1
    shape = pairs[0].degraded.alpha.shape
    work = Workload(*shape, batch=clips, train=True, trainable=config.trainable, shards=shards)
    capacity = device_memory()
    need = require_fit(config.network, work, capacity)
    print(f"memory a device: {need.total / GIB:.1f} GiB foreseen of {capacity / GIB:.1f} GiB", flush=True)


def device_memory() -> int:
    """Bytes that the first device may use; on a CPU, all of the machine's."""
    limit = (jax.local_devices()[0].memory_stats() or {}).get("bytes_limit")
    return limit or machine_bytes()


def _first_state(config: WanTrainConfig, checkpoints: TrainingCheckpoints, resume: bool) -> WanState:
    last = last_step(config, checkpoints, resume)
    network, words = config.network, config.sampling.words
    random = config.weights is None
    params = random_wan(config.seed, network) if random else read_wan(config.weights, network, words=words)
    state = jax.tree.map(np.asarray, initial_wan_state(params, config))  # NumPy's arrays may be laid over any devices
    return state if last is None else state.replace(train=checkpoints.restore(last, state.train))
