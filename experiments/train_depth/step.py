"""One step of training the distance network. The backbone's parameters are what it came with plus `backbone_rate`
times what is learned, so that one optimizer moves it slower, and weight decay draws it back."""

from functools import partial

import jax
import jax.numpy as jnp

from experiments.train_depth.config import DepthTrainConfig
from experiments.train_restore.guarded_step import TrainState, guarded_step
from rein3d_jax.depth.network.loss import DepthExample, depth_loss
from rein3d_jax.depth.network.network import DepthNetwork
from rein3d_jax.parallel.data_parallel import Total


def make_depth_step(start: dict, config: DepthTrainConfig):
    """step(state, batch, total) -> (state, metrics), as `data_parallel` takes it."""

    def step(state: TrainState, batch: DepthExample, total: Total):
        loss = partial(examples_depth_loss, start=start, config=config)
        return guarded_step(state, batch, total, loss=loss, config=config)

    return step


def learned_part(parameters: dict) -> dict:
    """What is trained of the network's parameters at the start: nothing is learned of the backbone yet."""
    return {**parameters, "backbone": jax.tree.map(jnp.zeros_like, parameters["backbone"])}


def whole_network(learned: dict, start: dict, rate: float) -> dict:
    """The network's parameters: backbone = start + rate x learned."""
    backbone = jax.tree.map(lambda a, b: a + rate * b, start, learned["backbone"])
    return {**learned, "backbone": backbone}


def examples_depth_loss(
    learned: dict, examples: DepthExample, *, start: dict, config: DepthTrainConfig
) -> tuple[jax.Array, jax.Array]:
    """Sum of penalties and number of a batch's examples (n, h, w)."""
    parameters = whole_network(learned, start, config.backbone_rate)
    predicted = DepthNetwork(config.network, config.frozen).apply({"params": parameters}, examples.rgb)
    return depth_loss(predicted, examples, config.loss)
