"""One step of training the learned restorer: examples as they might have been, noise, and the loss."""

from functools import partial

import jax
import jax.numpy as jnp
from flax import struct

from experiments.train_restore.config import TrainConfig
from experiments.train_restore.guarded_step import TrainState, first_state, guarded_step
from rein3d_jax.parallel.data_parallel import Total
from rein3d_jax.restore.learned.augment import augment
from rein3d_jax.restore.learned.loss import Example, noised, restoration_loss
from rein3d_jax.restore.learned.network import initial_parameters
from rein3d_jax.restore.learned.predict import predict


@struct.dataclass
class Batch:
    """Examples with leading axes (accumulate, batch / accumulate), and the randomness of each."""

    examples: Example
    seeds: jax.Array  # (accumulate, b, 2) uint32 key data


def initial_state(config: TrainConfig) -> TrainState:
    """The state before the first step: the network starts as the fills' mean."""
    parameters = initial_parameters(jax.random.key(config.seed), config.network)
    return first_state(parameters, config.optimizer, config.steps)


def make_step(config: TrainConfig):
    """step(state, batch, total) -> (state, metrics), as `data_parallel` takes it."""
    options = {"config": config.optimizer, "guard": config.guard, "steps": config.steps}

    def step(state: TrainState, batch: Batch, total: Total):
        return guarded_step(state, batch, total, loss=partial(examples_loss, config=config), **options)

    return step


def examples_loss(parameters: dict, batch: Batch, *, config: TrainConfig) -> tuple[jax.Array, jax.Array]:
    """(sum of penalties, sum of weights) of a batch (b, ...)."""
    keys = jax.vmap(jax.random.split)(jax.random.wrap_key_data(batch.seeds))
    examples = jax.vmap(augment)(keys[:, 0], batch.examples)
    noisy, level = jax.vmap(lambda key, one: noised(key, one, config.noise, config.noise_kind))(keys[:, 1], examples)
    dtype = jnp.dtype(config.precision)
    predicted = predict(parameters, examples.clip, noisy, level, config=config.network, dtype=dtype)
    return restoration_loss(predicted, examples, config.loss)
