"""One step of training for any network: the gradient over the whole batch, however it is split, an update, the guard
that refuses steps out of the common, and the parameters' moving average."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import optax
from flax import struct

from experiments.train_restore.config import GuardConfig, OptimizerConfig
from rein3d_jax.parallel.data_parallel import Total

# (parameters, a part of the batch) -> (sum of the penalties, sum of the weights)
Loss = Callable[[Any, Any], tuple[jax.Array, jax.Array]]

USUAL = 0.98  # decay of the usual gradient norm


@struct.dataclass
class TrainState:
    """All that the next step depends on, besides the config and the batch."""

    step: jax.Array  # () int32, steps taken or skipped
    parameters: Any
    average: Any  # the parameters' moving average
    optimizer: optax.OptState
    usual: jax.Array  # () the gradient's usual norm; 0 until the first step
    skipped: jax.Array  # () int32, steps that the guard refused, in all
    in_a_row: jax.Array  # () int32, of them, since the last one taken


def optimizer(config: OptimizerConfig, steps: int) -> optax.GradientTransformation:
    """Clip, then AdamW; the rate rises over the warm-up, stays, and falls over the cool-down."""
    parts = [optax.linear_schedule(0.0, config.rate, config.warmup), optax.constant_schedule(config.rate)]
    ends = [config.warmup]
    if config.cooldown:
        parts.append(optax.cosine_decay_schedule(config.rate, config.cooldown))
        ends.append(steps - config.cooldown)
    return optax.chain(
        optax.clip_by_global_norm(config.clip),
        optax.adamw(
            optax.join_schedules(parts, ends),
            b1=config.momentum,
            b2=config.second_momentum,
            weight_decay=config.weight_decay,
            mask=lambda tree: jax.tree.map(lambda x: x.ndim > 1, tree),
        ),
    )


def first_state(parameters: Any, config: OptimizerConfig, steps: int) -> TrainState:
    """The state before the first step."""
    zero, average = jnp.zeros((), jnp.int32), jax.tree.map(jnp.copy, parameters)
    return TrainState(zero, parameters, average, optimizer(config, steps).init(parameters), jnp.zeros(()), zero, zero)


def guarded_step(
    state: TrainState, batch: Any, total: Total, *, loss: Loss, config: OptimizerConfig, guard: GuardConfig, steps: int
) -> tuple[TrainState, dict[str, jax.Array]]:
    """The next state and what there is to say of it. `batch` has a leading axis of parts, taken one after another;
    `total` sums over devices (parallel/data_parallel.py)."""
    gradient, value = batch_gradient(loss, state.parameters, batch, total)
    norm = optax.tree.norm(gradient)
    changes, moments = optimizer(config, steps).update(gradient, state.optimizer, state.parameters)
    parameters = optax.apply_updates(state.parameters, changes)
    decay = jnp.minimum(config.average, (1 + state.step) / (10 + state.step))
    taken = state.replace(
        parameters=parameters,
        average=jax.tree.map(lambda a, p: (decay * a + (1 - decay) * p).astype(a.dtype), state.average, parameters),
        optimizer=moments,
        usual=jnp.where(state.usual > 0, USUAL * state.usual + (1 - USUAL) * norm, norm),
        in_a_row=jnp.zeros_like(state.in_a_row),
    )
    refused = state.replace(skipped=state.skipped + 1, in_a_row=state.in_a_row + 1)
    good = usual(norm, value, state.usual, guard)
    state = jax.tree.map(lambda a, b: jnp.where(good, a, b), taken, refused)
    metrics = {"loss": value, "gradient": norm, "skipped": state.skipped, "in_a_row": state.in_a_row}
    return state.replace(step=state.step + 1), metrics


def usual(norm: jax.Array, value: jax.Array, before: jax.Array, guard: GuardConfig) -> jax.Array:
    """Whether a step may be taken: all is finite and, once the usual norm is known, nothing out of the common."""
    return jnp.isfinite(norm) & jnp.isfinite(value) & ((before == 0) | (norm <= guard.spike * before))


def batch_gradient(loss: Loss, parameters: Any, batch: Any, total: Total) -> tuple[Any, jax.Array]:
    """Gradient and value of sum(penalties) / sum(weights) over all parts and devices, as of one large batch."""

    def add(sums, part):
        (penalty, weight), gradient = jax.value_and_grad(loss, has_aux=True)(parameters, part)
        return jax.tree.map(jnp.add, sums, (gradient, penalty, weight)), None

    nothing = (jax.tree.map(jnp.zeros_like, parameters), jnp.zeros(()), jnp.zeros(()))
    # Summed after the gradient is taken: pmap's gradient of a psum is n times each device's own, and no sum.
    if len(jax.tree.leaves(batch)[0]) == 1:  # XLA's CPU code is eight times slower inside a loop, even of one turn
        sums, _ = add(nothing, jax.tree.map(lambda x: x[0], batch))
    else:
        sums, _ = jax.lax.scan(add, nothing, batch)
    gradient, penalty, weight = total(sums)
    weight = jnp.maximum(weight, 1e-9)
    return jax.tree.map(lambda g: g / weight, gradient), penalty / weight
