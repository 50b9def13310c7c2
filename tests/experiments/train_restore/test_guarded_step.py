"""The step that every training shares, on a loss whose gradient is known."""

import os
import subprocess
import sys
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from experiments.train_restore.config import GuardConfig, OptimizerConfig, TrainConfig
from experiments.train_restore.guarded_step import batch_gradient, first_state, guarded_step
from rein3d_jax.parallel import BACKENDS, data_mesh, data_parallel, gather

PARAMETERS = {"a": jnp.array([1.0, 2.0]), "b": jnp.array(3.0)}
# Float32 sums of 8 terms, whose magnitudes sum to less than twice the sum: 8^0.5 eps 2 = 7e-7 in any order; each
# term is a sum itself, and its rounding some times that.
RTOL = 1e-5
BATCH = np.random.default_rng(0).normal(size=(8, 2)).astype(np.float32)
CONFIG = TrainConfig(
    steps=10, optimizer=OptimizerConfig(rate=0.1, warmup=0, clip=1e9, average=0.5), guard=GuardConfig(spike=10.0)
)


def loss(parameters, part):
    """Weights differ from example to example, so a mean of means is another number."""
    weight = jnp.abs(part[:, 0])
    return jnp.sum(weight * jnp.square(part @ parameters["a"] + parameters["b"])), jnp.sum(weight)


def alone(x):
    return x


@jax.jit
def step(state, batch):
    return guarded_step(state, batch, alone, loss=loss, config=CONFIG)


def mean_loss(parameters):
    penalty, weight = loss(parameters, BATCH)
    return penalty / weight


@pytest.mark.parametrize("parts", [1, 2, 4, 8])
def test_a_batch_in_parts_has_the_gradient_of_the_whole(parts):
    gradient, value = batch_gradient(loss, PARAMETERS, BATCH.reshape(parts, -1, 2), alone)
    whole, expected = jax.grad(mean_loss)(PARAMETERS), mean_loss(PARAMETERS)
    np.testing.assert_allclose(value, expected, rtol=RTOL)
    jax.tree.map(partial(np.testing.assert_allclose, rtol=RTOL), gradient, whole)


def test_a_step_descends_and_the_average_follows():
    state = first_state(PARAMETERS, CONFIG)
    after, metrics = step(state, BATCH[None])
    assert mean_loss(after.parameters) < metrics["loss"] and int(after.step) == 1
    # The first step's decay is (1 + 0) / (10 + 0).
    np.testing.assert_allclose(after.average["a"], 0.1 * PARAMETERS["a"] + 0.9 * after.parameters["a"], rtol=1e-6)


@pytest.mark.parametrize("poison", [np.nan, np.inf, 100.0])
def test_a_gradient_far_above_its_running_norm_is_not_followed_but_counted(poison):
    state, _ = step(first_state(PARAMETERS, CONFIG), BATCH[None])
    bad, metrics = step(state, poison * BATCH[None])
    for name in ("parameters", "average", "optimizer", "running_norm"):
        jax.tree.map(np.testing.assert_array_equal, getattr(bad, name), getattr(state, name))
    assert (int(bad.step), int(bad.skipped), int(metrics["in_a_row"])) == (2, 1, 1)
    good, _ = step(bad, BATCH[None])
    assert (int(good.step), int(good.skipped), int(good.in_a_row)) == (3, 1, 0)


@pytest.mark.parametrize("poison", [np.nan, np.inf])
def test_the_first_step_is_not_followed_either_where_it_is_not_finite(poison):
    state = first_state(PARAMETERS, CONFIG)
    bad, _ = step(state, poison * BATCH[None])
    jax.tree.map(np.testing.assert_array_equal, bad.parameters, PARAMETERS)
    assert (int(bad.skipped), float(bad.running_norm)) == (1, 0.0)


def test_a_state_can_be_donated():
    """No two leaves are one buffer, which XLA would refuse to take twice; and the parameters stay the caller's."""
    given = jax.tree.map(jnp.copy, PARAMETERS)
    donating = jax.jit(partial(guarded_step, total=alone, loss=loss, config=CONFIG), donate_argnums=0)
    state = first_state(given, CONFIG)
    after, _ = donating(state, BATCH[None])
    assert state.average["a"].is_deleted() and int(after.step) == 1
    jax.tree.map(np.testing.assert_array_equal, after, step(first_state(PARAMETERS, CONFIG), BATCH[None])[0])


def test_four_devices_have_the_gradient_of_one():
    """Both backends, in a process of its own: a process has the devices that it begins with."""
    flags = f"{os.environ.get('XLA_FLAGS', '')} --xla_force_host_platform_device_count=4"
    subprocess.run(
        [sys.executable, __file__],
        check=True,
        cwd=Path(__file__).parents[3],
        env={**os.environ, "XLA_FLAGS": flags, "JAX_PLATFORMS": "cpu", "PYTHONPATH": "."},
    )


def on_many_devices():
    """Raises AssertionError where a backend's gradient, in one part or two, or over parameters that the devices share
    (FSDP), is not that of a single device."""

    def gradient(parameters, batch, total):
        return parameters, batch_gradient(loss, parameters, batch, total)[0]

    assert jax.device_count() == 4
    for backend in BACKENDS:
        for parts in (1, 2):
            run = data_parallel(gradient, data_mesh(), backend=backend, axis=1)
            _, found = run(jax.tree.map(np.asarray, PARAMETERS), BATCH.reshape(parts, -1, 2))
            jax.tree.map(partial(np.testing.assert_allclose, rtol=RTOL), found, jax.grad(mean_loss)(PARAMETERS))
    wide = {"a": np.linspace(0, 1, 2048, dtype=np.float32).reshape(2, 1024), "b": np.zeros(1024, np.float32)}

    def wide_gradient(parameters, batch, total):
        return parameters, batch_gradient(wide_loss, parameters, batch, total)[0]

    state, found = data_parallel(wide_gradient, data_mesh(), axis=1, sharded=True)(wide, BATCH[None])
    assert state["a"].addressable_data(0).shape == (2, 256) and not state["a"].is_fully_replicated
    jax.tree.map(np.testing.assert_array_equal, gather(state), wide)
    alone = jax.grad(lambda p: wide_loss(p, BATCH)[0] / wide_loss(p, BATCH)[1])(wide)
    # Magnitudes sum to 3.6 at most: 8^0.5 eps 3.6 = 1e-6 in any order, and the terms themselves are rounded.
    jax.tree.map(partial(np.testing.assert_allclose, atol=5e-6), found, alone)


def wide_loss(parameters, part):
    weight = jnp.abs(part[:, :1])
    return jnp.sum(weight * jnp.square(part @ parameters["a"] + parameters["b"])), jnp.sum(weight)


if __name__ == "__main__":
    on_many_devices()
