"""Processes that train as one end where one process does, a killed one ends all in a line, and any number of them goes
on from what the others saved."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.sharding import NamedSharding, PartitionSpec

from experiments.train_restore.config import OptimizerConfig, TrainConfig
from experiments.train_restore.guarded_step import first_state, guarded_step
from experiments.train_restore.run import HeldOut, TrainingRun, last_step
from rein3d_jax.errors import InputError
from rein3d_jax.io.files.training_checkpoint import TrainingCheckpoints
from rein3d_jax.parallel import data_mesh, data_parallel, gather, join_hosts, state_shardings, tethered

ROOT = Path(__file__).parents[2]
WIDE = 1024  # numbers a row: enough to be split over devices
CONFIG = TrainConfig(
    steps=10,
    batch=8,
    log_every=1,
    save_every=5,
    evaluate_every=10,
    optimizer=OptimizerConfig(rate=0.01, warmup=2, cooldown=3, average=0.9),
)
# Losses are float32 sums of 8 terms, of one sign, that are sums of 1,024 themselves, in another order.
LOSS_RTOL = 1e-6
PATIENCE = 60.0  # seconds in which the others of a killed process must end; they take less than one


def loss(parameters, part):
    weight = jnp.abs(part[:, :1])
    error = jnp.square(jnp.tanh(part @ parameters["a"]) + parameters["b"] - 0.5)
    return jnp.sum(weight * error) / WIDE, jnp.sum(weight)


def batch_of(step: int) -> np.ndarray:
    """This process's share of one step's examples."""
    whole = np.random.default_rng((0, step)).normal(size=(CONFIG.batch, 2)).astype(np.float32)
    return np.split(whole, jax.process_count())[jax.process_index()][None]


class LineRun(TrainingRun):
    """Training whose process `victim` is killed after step 7, two steps after a checkpoint."""

    victim = None

    def after(self, state, metrics):
        super().after(state, metrics)
        if self.step == 7:
            self.checkpoints.manager.wait_until_finished()
            if jax.process_index() == self.victim:
                os.kill(os.getpid(), signal.SIGKILL)

    def held_out(self, average):
        return HeldOut(0.0, {}, np.zeros((2, 2, 3)), "")

    def write_weights(self, average):
        np.savez(self.output / "weights.npz", **average)


def train(output, *, resume=False, sharded=False, victim=None):
    """Last state, whole, of a run to CONFIG.steps."""
    config, mesh = replace(CONFIG, output=str(output)), data_mesh()

    def step(state, batch, total):
        return guarded_step(state, batch, total, loss=loss, config=config)

    run_step = data_parallel(step, mesh, axis=1, sharded=sharded)
    rng = np.random.default_rng(1)
    start = {"a": rng.normal(size=(2, WIDE)).astype(np.float32), "b": np.zeros(WIDE, np.float32)}
    with TrainingCheckpoints(Path(output) / "checkpoints") as checkpoints:
        last, state = last_step(config, checkpoints, resume), jax.tree.map(np.asarray, first_state(start, config))
        layout = state_shardings(mesh, state) if sharded else NamedSharding(mesh, PartitionSpec())
        state = jax.device_put(state if last is None else checkpoints.restore(last, state), layout)
        assert sharded != state.parameters["a"].is_fully_replicated
        with LineRun(config, None, checkpoints, int(state.step)) as run:
            run.victim = victim
            while run.step < config.steps:
                state, metrics = run_step(state, batch_of(run.step))
                run.after(state, metrics)
    return gather(state)


def started(count: int, work: str, *arguments) -> list[subprocess.Popen]:
    """Processes of this file, joined."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    environment = {**os.environ, "JAX_PLATFORMS": "cpu", "PYTHONPATH": "."}
    commands = [[sys.executable, __file__, address, str(count), str(i), work, *arguments] for i in range(count)]
    return [
        subprocess.Popen(command, cwd=ROOT, env=environment, stderr=subprocess.PIPE, text=True) for command in commands
    ]


def ended(processes) -> list[tuple[int, str]]:
    """Their exit codes and what they said."""
    try:
        said = [process.communicate(timeout=240)[1] for process in processes]
        return [(process.returncode, text) for process, text in zip(processes, said, strict=True)]
    finally:
        for process in processes:
            process.kill()


def losses(output) -> dict[int, float]:
    """By step; a step that was taken again after a kill has its last one."""
    records = map(json.loads, (Path(output) / "log.jsonl").read_text().splitlines())
    return {record["step"]: record["loss"] for record in records if "loss" in record}


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """(folder, last state) of one process's run."""
    return (folder := tmp_path_factory.mktemp("alone")), train(folder)


def same_training(output, state, alone):
    folder, expected = alone
    of_one, found = losses(folder), losses(output)
    assert of_one.keys() == found.keys() == set(range(1, CONFIG.steps + 1))
    np.testing.assert_allclose(list(found.values()), list(of_one.values()), rtol=LOSS_RTOL)
    for name, whole in expected.parameters.items():
        # Adam divides a gradient by its size: where a gradient is all rounding, so is the step, of rate 0.01 at most.
        error = np.linalg.norm(state.parameters[name] - whole) / np.linalg.norm(whole)
        assert error < 1e-6, (name, error)


def killed_in_the_middle(output, count, victim, *options):
    """Raises AssertionError unless all end in time, each with a line that names the victim."""
    processes = started(count, "train", str(output), f"victim={victim}", *options)
    processes[victim].wait(timeout=240)
    begun = time.monotonic()
    codes = ended(processes)
    assert time.monotonic() - begun < PATIENCE
    line = f"toy: process {victim} of {count} was killed or cut off: start all again with --resume"
    for index, (code, said) in enumerate(codes):
        assert code == (-signal.SIGKILL if index == victim else 2), said[-2000:]
        assert index == victim or said.count(line) == 1, said[-2000:]
        assert "Traceback" not in said


def test_two_processes_one_of_them_killed_and_one_that_goes_on_train_as_one(alone, tmp_path):
    killed_in_the_middle(tmp_path, 2, 1)
    assert max(losses(tmp_path)) in (6, 7)
    same_training(tmp_path, train(tmp_path, resume=True), alone)


@pytest.mark.slow  # 6 processes
@pytest.mark.parametrize("victim", [0, 3])
def test_four_processes_with_shares_of_the_state_are_killed_and_two_go_on(alone, tmp_path, victim):
    killed_in_the_middle(tmp_path, 4, victim, "sharded")
    for code, said in ended(started(2, "train", str(tmp_path), "sharded", "resume")):
        assert code == 0, said[-2000:]
    with TrainingCheckpoints(tmp_path / "checkpoints") as checkpoints:
        assert checkpoints.last() == CONFIG.steps
        same_training(tmp_path, checkpoints.restore(CONFIG.steps, alone[1]), alone)


def test_an_error_of_one_process_is_said_by_all():
    first, second = ended(started(2, "fail"))
    assert first[0] == second[0] == 2
    assert "toy: process 1 of 2 ended: no such folder; make it" in first[1]
    assert second[1].count("toy: no such folder; make it") == 1


def main(address: str, count: str, index: str, work: str, *arguments: str) -> int:
    """Exit code of one of several processes."""

    def say(line):
        print(f"toy: {line}", file=sys.stderr)

    join_hosts(address, int(count), int(index))
    options = dict(argument.split("=") for argument in arguments if "=" in argument)
    try:
        with tethered(address, say):
            if work == "fail":
                if jax.process_index() == 1:
                    raise InputError("no such folder; make it")
                time.sleep(PATIENCE)
            flags = {name: True for name in ("sharded", "resume") if name in arguments}
            train(arguments[0], victim=int(options.get("victim", -1)), **flags)
    except InputError as error:
        say(str(error))
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
