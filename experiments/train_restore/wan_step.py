"""One step of training the full-size network: pairs to latents and control, the loss, and what of it is trained."""

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from flax import struct

from experiments.train_restore.guarded_step import TrainState, first_state, guarded_step
from experiments.train_restore.wan_config import WanTrainConfig
from experiments.train_restore.wan_data import Clips
from rein3d_jax.parallel.data_parallel import Total
from rein3d_jax.restore.wan.dit import Dit
from rein3d_jax.restore.wan.restore import WanParams
from rein3d_jax.restore.wan.training.objective import flow_loss, target_of
from rein3d_jax.restore.wan.training.trainable import assemble, start_training
from rein3d_jax.restore.wan.vae import Vae


@struct.dataclass
class Fixed:
    """What a step needs and no step changes."""

    frozen: Any  # what `start_training` leaves of the transformer
    vae: dict
    text: jax.Array  # (m, text_dim), the same for each clip: the pairs have no words of their own
    no_text: jax.Array  # only passed on, to whoever samples with guidance


@struct.dataclass
class WanState:
    train: TrainState  # what a checkpoint holds
    fixed: Fixed


def start(params: WanParams, config: WanTrainConfig) -> WanState:
    """The state before the first step."""
    trained, frozen = start_training(jax.random.key(config.seed), params.dit, config.trainable)
    train = first_state(trained, config.optimizer, config.steps)
    return WanState(train, Fixed(frozen, params.vae, params.text, params.no_text))


def make_step(config: WanTrainConfig):
    """step(state, batch, total) -> (state, metrics), as `data_parallel` takes it."""
    options = {"config": config.optimizer, "guard": config.guard, "steps": config.steps}

    def step(state: WanState, batch: Clips, total: Total):
        loss = partial(clips_loss, fixed=state.fixed, config=config)
        train, metrics = guarded_step(state.train, batch, total, loss=loss, **options)
        return state.replace(train=train), metrics

    return step


def clips_loss(trained: Any, clips: Clips, *, fixed: Fixed, config: WanTrainConfig) -> tuple[jax.Array, jax.Array]:
    """(sum of penalties, sum of weights) of clips (b, ...). Each room is turned at random before it is encoded."""
    keys = jax.vmap(jax.random.split)(jax.random.wrap_key_data(clips.seed))
    clean, rgb, alpha = jax.vmap(_turned)(keys[:, 0], (clips.clean, clips.rgb, clips.alpha))
    network, vae = config.network, Vae(config.network.vae)

    @jax.jit  # traced once for five videos
    def encode(video):
        return vae.apply({"params": fixed.vae}, video, method="encode")

    def predict(x, timestep, control):
        text = jnp.broadcast_to(fixed.text, (len(x), *fixed.text.shape))
        return Dit(network.dit).apply({"params": params}, x, timestep, text, control)

    params = assemble(trained, fixed.frozen, config.trainable)
    target = target_of(encode, clean, rgb, alpha, stride=network.vae.stride)
    return flow_loss(predict, target, keys[:, 1], config.objective)


def adapted(trained: Any, state: WanState, config: WanTrainConfig) -> WanParams:
    """Ordinary parameters, for sampling and saving, of `trained`: the state's parameters or their average."""
    fixed = state.fixed
    return WanParams(assemble(trained, fixed.frozen, config.trainable), fixed.vae, fixed.text, fixed.no_text)


def _turned(key: jax.Array, images: tuple[jax.Array, ...]) -> tuple[jax.Array, ...]:
    """Panoramas (t, h, w, ...) turned by the same random number of columns."""
    columns = jax.random.randint(key, (), 0, images[0].shape[2])
    return tuple(jnp.roll(image, columns, axis=2) for image in images)
