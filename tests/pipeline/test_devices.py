"""Refinement over four devices, or two processes, takes the steps that one takes."""

import importlib.util
import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.parallel import data_mesh
from rein3d_jax.pipeline.devices import steps_over

pytestmark = pytest.mark.slow  # a process of its own with four devices

ROOT = Path(__file__).parents[2]
DEVICES = 4


def test_four_devices_take_the_step_of_one():
    """In a process of its own: a process has the devices that it begins with."""
    flags = f"{os.environ.get('XLA_FLAGS', '')} --xla_force_host_platform_device_count={DEVICES}"
    environment = {**os.environ, "XLA_FLAGS": flags, "JAX_PLATFORMS": "cpu", "PYTHONPATH": "."}
    command = [sys.executable, __file__]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr[-2000:]


def test_two_processes_refine_as_one(tmp_path):
    import numpy as np

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    environment = {**os.environ, "JAX_PLATFORMS": "cpu", "PYTHONPATH": "."}
    commands = [[sys.executable, __file__, address, str(index), str(tmp_path / "two.npz")] for index in range(2)]
    both = [subprocess.Popen(x, cwd=ROOT, env=environment, stderr=subprocess.PIPE, text=True) for x in commands]
    try:
        refined_alone(tmp_path / "one.npz")
        for process in both:
            _, said = process.communicate(timeout=300)
            assert process.returncode == 0, said[-2000:]
    finally:
        for process in both:
            process.kill()
    with np.load(tmp_path / "one.npz") as one, np.load(tmp_path / "two.npz") as two:
        assert len(one["loss"]) == 10 and one.files == two.files
        np.testing.assert_allclose(two["loss"], one["loss"], rtol=1e-6)  # float32 sums in another order
        np.testing.assert_allclose(two["psnr"], one["psnr"], atol=1e-4)  # dB
        for name in set(one.files) - {"loss", "psnr", "sh_rest"}:  # harmonics that have only begun are rounding
            error = np.linalg.norm(two[name] - one[name]) / np.linalg.norm(one[name])
            assert error < 1e-5, (name, error)  # a gradient of rounding alone is as large a step as any, in Adam


def test_a_batch_that_cannot_be_shared_is_refused():
    class Three:
        size = 3

    class Config:
        batch = 4

    with pytest.raises(InputError, match=r"refine.batch 4 is not divided by 3 devices"):
        steps_over(Three())(None, None, None, config=Config(), raster=None, buffers=None)
    assert data_mesh(1).size == 1


def refined_alone(path, take_step=None):
    """Writes the curves and parameters of 10 steps, over a densification and two evaluations."""
    import dataclasses

    import jax
    import numpy as np

    from rein3d_jax.refine import first_snapshot, refine
    from rein3d_jax.refine.step import take_step as alone

    toy = toy_of_refine()
    config, views, start = dataclasses.replace(toy.CONFIG, batch=4), toy.make_views(), toy.blurred(toy.make_scene())
    first = first_snapshot(start, views, extent=2.0, config=config, raster=toy.RASTER)
    first = first.replace(buffers=jax.numpy.array(toy.BUFFERS))
    fixed = {"config": config, "raster": toy.RASTER, "take_step": take_step or alone}
    *_, last = refine(first, views, jax.random.key(0), **fixed)
    curves = {"loss": last.curves.loss[:, 1], "psnr": last.curves.psnr[:, 1]}
    np.savez(path, **curves, **last.state.parameters)


def refined_as_one_of_two(address, index, path):
    from rein3d_jax.parallel import join_hosts, tethered

    join_hosts(address, 2, int(index))
    with tethered(address, print):
        refined_alone(path if index == "0" else f"{path}.{index}.npz", steps_over(data_mesh()))


def toy_of_refine():
    spec = importlib.util.spec_from_file_location("toy", ROOT / "tests" / "refine" / "conftest.py")
    toy = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(toy)
    return toy


def on_four_devices():
    """Raises AssertionError where losses or gradients' sums differ, or an overflow goes unseen."""
    import dataclasses

    import jax
    import numpy as np

    from rein3d_jax.refine.state import initial_state
    from rein3d_jax.refine.step import Chance, take_step

    toy = toy_of_refine()
    assert jax.device_count() == DEVICES
    config = dataclasses.replace(toy.CONFIG, batch=DEVICES)
    views, start = toy.make_views(), toy.blurred(toy.make_scene())
    chance = Chance(jax.numpy.array([1, 2, 3, 5]), jax.numpy.array([0.2, 0.6, 0.9]), jax.random.key(0))
    fixed = {"config": config, "raster": toy.RASTER, "buffers": toy.BUFFERS}
    found = []
    for run in (take_step, steps_over(data_mesh())):
        state = initial_state(start, config, extent=2.0)
        found.append(run(state, views, chance, **fixed))
    (alone, of_one), (shared, of_four) = found
    np.testing.assert_allclose(of_four["loss"], of_one["loss"], rtol=1e-5)  # float32 sums in another order
    np.testing.assert_allclose(shared.gradient_sum, alone.gradient_sum, rtol=1e-3, atol=1e-6)  # likewise, of 256 pixels
    np.testing.assert_array_equal(shared.seen, alone.seen)
    for name in alone.parameters:  # Adam's first moment after one step is a tenth of the gradient
        one, four = (np.asarray(s.optimizer.inner_states[name].inner_state[0].mu[name]) for s in (alone, shared))
        np.testing.assert_allclose(four, one, atol=1e-4 * np.abs(one).max(initial=0), err_msg=name)  # float32 sums
    tight = fixed | {"buffers": toy.BUFFERS._replace(pairs=16)}
    _, cut = steps_over(data_mesh())(initial_state(start, config, extent=2.0), views, chance, **tight)
    _, whole = take_step(initial_state(start, config, extent=2.0), views, chance, **tight)
    assert int(cut["overflow"]) == int(whole["overflow"]) > 0
    assert np.all(np.asarray(cut["needed"])[2] >= np.asarray(whole["needed"])[2])  # no less than any needs


if __name__ == "__main__":
    refined_as_one_of_two(*sys.argv[1:]) if sys.argv[1:] else on_four_devices()
