"""One step of training the full-size network: pairs to latents and control, the loss, and what of it is trained."""

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from flax import struct

from experiments.train_restore.guarded_step import TrainState, first_state, guarded_step
from experiments.train_restore.wan.config import WanTrainConfig
from experiments.train_restore.wan.data import PairBatch
from rein3d_jax.parallel.data_parallel import Total
from rein3d_jax.restore.wan.dit import Dit
from rein3d_jax.restore.wan.restore import WanParams
from rein3d_jax.restore.wan.training.objective import flow_loss, flow_target
from rein3d_jax.restore.wan.training.trainable import assemble, start_training
from rein3d_jax.restore.wan.vae import Vae


@struct.dataclass
class FixedState:
    """What a step needs and no step changes."""

    frozen: Any  # what `start_training` leaves of the transformer
    vae: dict
    text: jax.Array  # (m, text_dim), the same for each clip: the pairs have no words of their own
    no_text: jax.Array  # only passed on, to whoever samples with guidance


@struct.dataclass
class WanState:
    """State of training the full-size network."""

    train: TrainState  # what a checkpoint holds
    fixed: FixedState


def initial_wan_state(params: WanParams, config: WanTrainConfig) -> WanState:
    """State before the first step."""
    trained, frozen = start_training(jax.random.key(config.seed), params.dit, config.trainable)
    train = first_state(trained, config)
    return WanState(train, FixedState(frozen, params.vae, params.text, params.no_text))


def make_wan_step(config: WanTrainConfig):
    """step(state, batch, total) -> (state, metrics), as `data_parallel` takes it."""

    def step(state: WanState, batch: PairBatch, total: Total):
        loss = partial(pairs_loss, fixed=state.fixed, config=config)
        train, metrics = guarded_step(state.train, batch, total, loss=loss, config=config)
        return state.replace(train=train), metrics

    return step


def pairs_loss(
    trained: Any, pairs: PairBatch, *, fixed: FixedState, config: WanTrainConfig
) -> tuple[jax.Array, jax.Array]:
    """Sum of penalties and sum of weights of pairs (b, ...). Each room gets a random yaw before it is encoded."""
    keys = jax.vmap(jax.random.split)(jax.random.wrap_key_data(pairs.seed))
    clean, rgb, alpha = jax.vmap(_yawed)(keys[:, 0], (pairs.clean, pairs.rgb, pairs.alpha))
    network, vae = config.network, Vae(config.network.vae)

    @jax.jit  # traced once for five videos
    def encode(video):
        return vae.apply({"params": fixed.vae}, video, method="encode")

    def predict(x, timestep, control):
        text = jnp.broadcast_to(fixed.text, (len(x), *fixed.text.shape))
        return Dit(network.dit).apply({"params": params}, x, timestep, text, control)

    params = assemble(trained, fixed.frozen, config.trainable)
    target = flow_target(encode, clean, rgb, alpha, stride=network.vae.stride)
    return flow_loss(predict, target, keys[:, 1], config.objective)


def adapted(trained: Any, fixed: FixedState, config: WanTrainConfig) -> WanParams:
    """Parameters for sampling and saving, of `trained`, a state's parameters or their average."""
    return WanParams(assemble(trained, fixed.frozen, config.trainable), fixed.vae, fixed.text, fixed.no_text)


def _yawed(key: jax.Array, images: tuple[jax.Array, ...]) -> tuple[jax.Array, ...]:
    """Panoramas (t, h, w, ...) rolled by the same random number of columns."""
    columns = jax.random.randint(key, (), 0, images[0].shape[2])
    return tuple(jnp.roll(image, columns, axis=2) for image in images)
