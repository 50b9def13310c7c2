"""One step of training for any network: the gradient over the whole batch, however it is split, an update, the guard
that refuses steps whose gradient is not finite or far above its running norm, and the parameters' moving average."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import optax
from flax import struct

from experiments.train_restore.config import GuardConfig, OptimizerConfig, TrainConfig
from rein3d_jax.parallel.data_parallel import Total

# (parameters, a part of the batch) -> (sum of the penalties, sum of the weights)
Loss = Callable[[Any, Any], tuple[jax.Array, jax.Array]]

_NORM_DECAY = 0.98  # of the gradient's running norm


@struct.dataclass
class TrainState:
    """State of training: all that the next step depends on, besides the config and the batch."""

    step: jax.Array  # () int32, steps taken or skipped
    parameters: Any
    average: Any  # the parameters' moving average
    optimizer: optax.OptState
    running_norm: jax.Array  # () the gradient's; 0 until the first step
    skipped: jax.Array  # () int32, steps that the guard refused, in all
    in_a_row: jax.Array  # () int32, of them, since the last one taken


def optimizer(config: OptimizerConfig, steps: int) -> optax.GradientTransformation:
    """Optimizer: clip, then AdamW; the rate rises over the warm-up, stays, and falls over the cool-down."""
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


def first_state(parameters: Any, config: TrainConfig) -> TrainState:
    """State before the first step."""
    step, skipped, in_a_row = (jnp.zeros((), jnp.int32) for _ in range(3))  # three buffers: each is donated
    average = jax.tree.map(jnp.copy, parameters)
    moments = optimizer(config.optimizer, config.steps).init(parameters)
    return TrainState(step, parameters, average, moments, jnp.zeros(()), skipped, in_a_row)


def guarded_step(
    state: TrainState, batch: Any, total: Total, *, loss: Loss, config: TrainConfig
) -> tuple[TrainState, dict[str, jax.Array]]:
    """The next state and its metrics. `batch` has a leading axis of parts, taken one after another;
    `total` sums over devices (parallel/data_parallel.py)."""
    gradient, value = batch_gradient(loss, state.parameters, batch, total)
    norm, before = optax.tree.norm(gradient), state.running_norm
    changes, moments = optimizer(config.optimizer, config.steps).update(gradient, state.optimizer, state.parameters)
    parameters = optax.apply_updates(state.parameters, changes)
    decay = jnp.minimum(config.optimizer.average, (1 + state.step) / (10 + state.step))
    taken = state.replace(
        parameters=parameters,
        average=jax.tree.map(lambda a, p: (decay * a + (1 - decay) * p).astype(a.dtype), state.average, parameters),
        optimizer=moments,
        running_norm=jnp.where(before > 0, _NORM_DECAY * before + (1 - _NORM_DECAY) * norm, norm),
        in_a_row=jnp.zeros_like(state.in_a_row),
    )
    refused = state.replace(skipped=state.skipped + 1, in_a_row=state.in_a_row + 1)
    good = _acceptable(norm, value, before, config.guard)
    state = jax.tree.map(lambda a, b: jnp.where(good, a, b), taken, refused)
    metrics = {"loss": value, "gradient": norm, "skipped": state.skipped, "in_a_row": state.in_a_row}
    return state.replace(step=state.step + 1), metrics


def _acceptable(norm: jax.Array, value: jax.Array, before: jax.Array, guard: GuardConfig) -> jax.Array:
    """Whether a step may be taken: all is finite and the gradient not far above its running norm, once it has one."""
    return jnp.isfinite(norm) & jnp.isfinite(value) & ((before == 0) | (norm <= guard.spike * before))


def batch_gradient(loss: Loss, parameters: Any, batch: Any, total: Total) -> tuple[Any, jax.Array]:
    """Gradient and value of sum(penalties) / sum(weights) over all parts and devices, as of one large batch."""

    def add(sums, part):
        (penalty, weight), gradient = jax.value_and_grad(loss, has_aux=True)(parameters, part)
        return jax.tree.map(jnp.add, sums, (gradient, penalty, weight)), None

    nothing = (jax.tree.map(jnp.zeros_like, parameters), jnp.zeros(()), jnp.zeros(()))
    # Summed after the gradient is taken: pmap's gradient of a psum is n times each device's own, and no sum.
    if len(jax.tree.leaves(batch)[0]) == 1:  # XLA's CPU code is eight times slower inside a loop, even of one iteration
        sums, _ = add(nothing, jax.tree.map(lambda x: x[0], batch))
    else:
        sums, _ = jax.lax.scan(add, nothing, batch)
    gradient, penalty, weight = total(sums)
    weight = jnp.maximum(weight, 1e-9)
    return jax.tree.map(lambda g: g / weight, gradient), penalty / weight
