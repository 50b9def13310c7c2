"""One step of training the learned restorer: augmented examples, noise, and the loss."""

from functools import partial

import jax
import jax.numpy as jnp
from flax import struct

from experiments.train_restore.guarded_step import TrainState, first_state, guarded_step
from experiments.train_restore.learned.config import LearnedTrainConfig
from rein3d_jax.parallel.data_parallel import Total
from rein3d_jax.restore.learned.augment import augment
from rein3d_jax.restore.learned.loss import Example, noisy_residual, restoration_loss
from rein3d_jax.restore.learned.network import initial_parameters
from rein3d_jax.restore.learned.predict import predict


@struct.dataclass
class ExampleBatch:
    """Examples with leading axes (accumulate, batch / accumulate), and the randomness of each."""

    examples: Example
    seeds: jax.Array  # (accumulate, b, 2) uint32 key data


def initial_learned_state(config: LearnedTrainConfig) -> TrainState:
    """State before the first step: the network starts as the fills' mean."""
    parameters = initial_parameters(jax.random.key(config.seed), config.network)
    return first_state(parameters, config)


def make_learned_step(config: LearnedTrainConfig):
    """step(state, batch, total) -> (state, metrics), as `data_parallel` takes it."""

    def step(state: TrainState, batch: ExampleBatch, total: Total):
        return guarded_step(state, batch, total, loss=partial(examples_loss, config=config), config=config)

    return step


def examples_loss(parameters: dict, batch: ExampleBatch, *, config: LearnedTrainConfig) -> tuple[jax.Array, jax.Array]:
    """Sum of penalties and sum of weights of a batch (b, ...)."""
    keys = jax.vmap(jax.random.split)(jax.random.wrap_key_data(batch.seeds))
    examples = jax.vmap(augment)(keys[:, 0], batch.examples)
    noisy, level = jax.vmap(partial(noisy_residual, share=config.noise, kind=config.noise_kind))(keys[:, 1], examples)
    dtype = jnp.dtype(config.precision)
    predicted = predict(parameters, examples.clip, noisy, level, config=config.network, dtype=dtype)
    return restoration_loss(predicted, examples, config.loss)
