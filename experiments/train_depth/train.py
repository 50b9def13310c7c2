"""Train the distance network on drawn and rendered rooms.

Writes into the output folder: config.toml, checkpoints/ (the last and the best), log.jsonl and TensorBoard events,
samples/STEP.png (held-out rooms: picture, true and estimated distance), and weights/, the best average so far.
"""

from pathlib import Path

import jax
import numpy as np
from jax.sharding import NamedSharding, PartitionSpec

from experiments.train_depth.config import DepthTrainConfig
from experiments.train_depth.data import DepthData
from experiments.train_depth.held_out import score_depth
from experiments.train_depth.step import learned_part, make_depth_step, whole_network
from experiments.train_restore.guarded_step import TrainState, first_state
from experiments.train_restore.run import HeldOut, TrainingRun, clips_per_device, last_step
from rein3d_jax.depth.network.network import initial_depth_parameters
from rein3d_jax.io.files.training_checkpoint import TrainingCheckpoints
from rein3d_jax.networks.depth import read_depth_backbone, read_depth_network, write_depth_network
from rein3d_jax.parallel import data_mesh, data_parallel


class DepthRun(TrainingRun):
    """A TrainingRun on DepthData, whose score is -AbsRel."""

    start: dict  # the backbone's parameters before training

    def held_out(self, average: dict) -> HeldOut:
        """Evaluation of averaged parameters on the rooms held out."""
        if self.data.rendered:
            self.data.rendered.refresh()
        return score_depth(self.data, whole_network(average, self.start, self.config.backbone_rate), self.config)

    def write_weights(self, average: dict) -> None:
        """Writes weights/ of averaged parameters."""
        write_depth_network(self.output / "weights", whole_network(average, self.start, self.config.backbone_rate))


def train_depth(config: DepthTrainConfig, *, resume: bool = False) -> TrainState:
    """Last state of a run to config.steps. Raises InputError for what is wrong with the input, and where the
    guard's patience ends."""
    output, mesh, data = Path(config.output), data_mesh(config.devices), DepthData(config)
    clips_per_device(config, mesh.size)
    parameters = start_parameters(config)
    backbone = jax.tree.map(np.asarray, parameters["backbone"])
    step = data_parallel(make_depth_step(backbone, config), mesh, backend=config.backend, axis=1)
    with TrainingCheckpoints(output / "checkpoints") as checkpoints:
        state, last = first_state(learned_part(parameters), config), last_step(config, checkpoints, resume)
        state = jax.tree.map(np.asarray, state)  # NumPy's arrays may be laid over any devices
        state = state if last is None else checkpoints.restore(last, state)
        state = jax.device_put(state, NamedSharding(mesh, PartitionSpec()))
        with DepthRun(config, data, checkpoints, int(state.step)) as run:
            run.start = backbone
            while run.step < config.steps:
                host, hosts = jax.process_index(), jax.process_count()
                state, metrics = step(state, data.batch(run.step, host=host, hosts=hosts))
                run.after(state, metrics)
    return state


def start_parameters(config: DepthTrainConfig) -> dict:
    """Parameters before training: drawn by the seed, the backbone or all of them read where the recipe names a
    folder."""
    if config.weights:
        return read_depth_network(config.weights, config.network)
    parameters = initial_depth_parameters(jax.random.key(config.seed), config.network)
    if not config.backbone:
        return parameters
    return {**parameters, "backbone": read_depth_backbone(config.backbone, config.network)}
