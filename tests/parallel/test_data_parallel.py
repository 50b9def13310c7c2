"""Many devices and many processes compute what one does; what cannot be joined is refused."""

import os
import socket
import subprocess
import sys
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from experiments.train_restore.guarded_step import batch_gradient
from experiments.train_restore.learned.config import LearnedTrainConfig
from experiments.train_restore.learned.step import ExampleBatch, examples_loss
from rein3d_jax.errors import InputError
from rein3d_jax.parallel import BACKENDS, data_mesh, data_parallel, gather, join_hosts, share_batch
from rein3d_jax.restore.learned.condition import CANDIDATES, Clip
from rein3d_jax.restore.learned.config import NetworkConfig
from rein3d_jax.restore.learned.loss import Example
from rein3d_jax.restore.learned.network import initial_parameters

pytestmark = pytest.mark.slow  # processes of their own with several devices

DEVICES = 8
ROOT = Path(__file__).parents[2]
NETWORK = NetworkConfig(rows=16, fine=8, width=8, depth=1, heads=1, expand=1)
LEARNED = LearnedTrainConfig(network=NETWORK)
LINE = {"a": np.float32([1.0, 2.0]), "b": np.array(3.0, np.float32)}
# Float32 sums of 8 terms, whose magnitudes sum to less than twice the sum: 8^0.5 eps 2 = 7e-7 in any order; each
# term is a sum itself, and its rounding some times that.
RTOL = 1e-5
POINTS = np.random.default_rng(0).normal(size=(8, 2)).astype(np.float32)


def line_loss(parameters, part):
    """Weights differ from example to example, so a mean of means is another number."""
    weight = jnp.abs(part[:, 0])
    return jnp.sum(weight * jnp.square(part @ parameters["a"] + parameters["b"])), jnp.sum(weight)


def line_gradient() -> dict:
    """By hand, in float64: of sum w (p a + b)^2 / sum w."""
    points = POINTS.astype(np.float64)
    slope = 2 * np.abs(points[:, 0]) * (points @ LINE["a"] + LINE["b"]) / np.abs(points[:, 0]).sum()
    return {"a": slope @ points, "b": slope.sum()}


def gradient(loss, parameters, batch, total):
    """A step whose result is the gradient."""
    return parameters, batch_gradient(loss, parameters, batch, total)[0]


def learned_batch(parts) -> ExampleBatch:
    """8 random examples, each with randomness of its own."""
    rng = np.random.default_rng(0)

    def values(*channels):
        return rng.random((parts, DEVICES // parts, 2, 16, 32, *channels), np.float32)

    position = rng.normal(size=(parts, DEVICES // parts, 2, 3)).astype(np.float32)
    clip = Clip(values(3), values(), 1 + values(), values(CANDIDATES, 3), 1 + values(CANDIDATES), position)
    seeds = rng.integers(0, 2**32, (parts, DEVICES // parts, 2), np.uint32)
    return ExampleBatch(Example(clip, values(3), 1 + values()), seeds)


def run_here(*arguments, flags="") -> subprocess.Popen:
    """This file as a process of its own: a process has the devices that it begins with."""
    flags = f"{os.environ.get('XLA_FLAGS', '')} {flags}"
    environment = {**os.environ, "XLA_FLAGS": flags, "JAX_PLATFORMS": "cpu", "PYTHONPATH": "."}
    command = [sys.executable, __file__, *arguments]
    return subprocess.Popen(command, cwd=ROOT, env=environment, stderr=subprocess.PIPE, text=True)


def succeed(processes) -> None:
    try:
        for process in processes:
            _, error = process.communicate(timeout=240)
            assert process.returncode == 0, error[-2000:]
    finally:
        for process in processes:
            process.kill()


def test_eight_devices_have_the_gradient_of_one():
    succeed([run_here("devices", flags=f"--xla_force_host_platform_device_count={DEVICES}")])


def on_eight_devices():
    """Raises AssertionError where they do not: the learned restorer's loss, which draws per example, by both backends;
    and a line's, its batch on 2, 4 and 8 devices against the same batch one part after another."""
    assert jax.device_count() == DEVICES
    learned = partial(gradient, partial(examples_loss, config=LEARNED))
    parameters = jax.tree.map(np.asarray, initial_parameters(jax.random.key(0), NETWORK))
    leaves, structure = jax.tree.flatten(parameters)
    rng = np.random.default_rng(1)
    parameters = structure.unflatten([x + 0.1 * rng.normal(size=x.shape).astype(np.float32) for x in leaves])
    _, alone = data_parallel(learned, data_mesh(1), axis=1)(parameters, learned_batch(1))
    assert all(np.any(np.asarray(x)) for x in jax.tree.leaves(alone))
    for backend in BACKENDS:
        _, found = data_parallel(learned, data_mesh(), backend=backend, axis=1)(parameters, learned_batch(1))
        for mine, theirs in zip(jax.tree.leaves(found), jax.tree.leaves(alone), strict=True):
            # float32 sums over 8 examples of 1,024 pixels in another order, against the array's largest number
            np.testing.assert_allclose(mine, theirs, atol=1e-4 * np.abs(theirs).max())
    for devices in (2, 8):
        for backend in BACKENDS:
            run = data_parallel(partial(gradient, line_loss), data_mesh(devices), backend=backend, axis=1)
            _, found = run(dict(LINE), POINTS[None])
            _, parts = data_parallel(partial(gradient, line_loss), data_mesh(1), axis=1)(
                dict(LINE), POINTS.reshape(devices, -1, 2)
            )
            jax.tree.map(partial(np.testing.assert_allclose, rtol=RTOL), found, parts)


def test_two_processes_have_the_gradient_of_one():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    succeed([run_here("process", str(port), str(index)) for index in range(2)])


def as_one_of_two(port: int, index: int):
    """Raises AssertionError where two processes, each with its half of the points, have another gradient."""
    join_hosts(f"127.0.0.1:{port}", 2, index)
    assert (jax.process_count(), jax.process_index(), jax.device_count()) == (2, index, 2)
    with pytest.raises(InputError, match="devices 1 is not divided by 2 processes"):
        data_mesh(1)
    half = POINTS[4 * index : 4 * index + 4]
    whole = gather(share_batch(data_mesh(), half))
    np.testing.assert_array_equal(whole, POINTS)
    for backend in BACKENDS:
        run = data_parallel(partial(gradient, line_loss), data_mesh(), backend=backend, axis=1)
        for parts in (1, 2):
            _, found = run(dict(LINE), half.reshape(parts, -1, 2))
            jax.tree.map(partial(np.testing.assert_allclose, rtol=RTOL), gather(found), line_gradient())
    state, _ = data_parallel(partial(gradient, line_loss), data_mesh(), axis=1, sharded=True)(
        {"a": LINE["a"], "b": LINE["b"]}, half[None]
    )
    jax.tree.map(np.testing.assert_array_equal, gather(state), LINE)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("parts", [1, 4])
def test_one_device_has_the_gradient_by_hand(backend, parts):
    run = data_parallel(partial(gradient, line_loss), data_mesh(1), backend=backend, axis=1)
    _, found = run(dict(LINE), POINTS.reshape(parts, -1, 2))
    jax.tree.map(partial(np.testing.assert_allclose, rtol=RTOL), found, line_gradient())


def test_what_cannot_be_had_is_refused_by_name():
    with pytest.raises(InputError, match="1000000 devices are asked for, but jax sees"):
        data_mesh(1_000_000)
    with pytest.raises(InputError, match='backend "threads" is unknown; choose one of jit, pmap'):
        data_parallel(gradient, data_mesh(1), backend="threads")
    with pytest.raises(InputError, match="has the whole state"):
        data_parallel(gradient, data_mesh(1), backend="pmap", sharded=True)


@pytest.mark.parametrize("given", [("host:1", None, None), (None, 2, 0), ("host:1", 2, None), (None, None, 0)])
def test_hosts_join_with_all_that_it_takes_or_not_at_all(given):
    with pytest.raises(InputError, match="--address, --processes and --process"):
        join_hosts(*given)
    join_hosts(None, None, None)
    assert jax.process_count() == 1


if __name__ == "__main__":
    if sys.argv[1] == "devices":
        on_eight_devices()
    else:
        as_one_of_two(*map(int, sys.argv[2:]))
