"""Training by many machines: bytes over the wire a step, counted in the compiled program, and steps a second here."""

import json
import math
import os
import re
import socket
import statistics
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import NamedSharding, PartitionSpec

from experiments.command import CommandParser
from experiments.config import dump_config
from experiments.example_store import write_examples
from experiments.train_restore.config import OptimizerConfig
from experiments.train_restore.learned.config import ExampleDataConfig, LearnedTrainConfig
from experiments.train_restore.learned.step import ExampleBatch, initial_learned_state, make_learned_step
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.parallel import data_mesh, state_shardings
from rein3d_jax.restore.learned.condition import CANDIDATES, Clip
from rein3d_jax.restore.learned.config import NetworkConfig
from rein3d_jax.restore.learned.loss import Example
from rein3d_jax.restore.wan.config import WanConfig
from rein3d_jax.restore.wan.training.memory import count, dit_shapes

DEVICES = (2, 4, 8)
PROCESSES = (1, 2)
ROWS, FRAMES, BATCH, STEPS = 16, 2, 8, 30
OPTIMIZER = OptimizerConfig(warmup=0)
CONFIG = LearnedTrainConfig(network=NetworkConfig(rows=ROWS), batch=BATCH, steps=STEPS, optimizer=OPTIMIZER)
# Bytes a second out of one device, of the makers' data sheets: NVLink of an H100, its share of a node's 8 x 400 Gb/s
# network, and a TPU v5e's links.
LINKS = {"H100, NVLink": 450e9, "H100, 400 Gb/s": 50e9, "TPU v5e": 200e9}
_COLLECTIVE = re.compile(r"= (.*?) (all-reduce|all-gather|reduce-scatter|all-to-all|collective-permute)(?:-start)?\(")
_ARRAY = re.compile(r"(f|bf|s|u|pred)(\d*)\[([\d,]*)\]")


def _abstract_batch() -> ExampleBatch:
    def array(*shape, dtype=jnp.float32):
        return jax.ShapeDtypeStruct(shape, dtype)

    area = (1, BATCH, FRAMES, ROWS, 2 * ROWS)
    fills = array(*area, CANDIDATES, 3), array(*area, CANDIDATES)
    clip = Clip(array(*area, 3), array(*area), array(*area), *fills, array(1, BATCH, FRAMES, 3))
    return ExampleBatch(Example(clip, array(*area, 3), array(*area)), array(1, BATCH, 2, dtype=jnp.uint32))


def wire(devices: int, *, sharded: bool) -> dict[str, int]:
    """Bytes of the arrays that each kind of collective gives or takes, in one step of the learned restorer."""
    mesh, state = data_mesh(devices), jax.eval_shape(partial(initial_learned_state, CONFIG))
    everywhere = NamedSharding(mesh, PartitionSpec())
    layout = state_shardings(mesh, state) if sharded else everywhere
    step = jax.jit(
        partial(make_learned_step(CONFIG), total=lambda x: x),
        in_shardings=(layout, NamedSharding(mesh, PartitionSpec(None, "data"))),
        out_shardings=(layout, everywhere),
        donate_argnums=0,
    )
    return collective_bytes(step.lower(state, _abstract_batch()).compile().as_text())


def collective_bytes(program: str) -> dict[str, int]:
    """Bytes of results by kind of collective, of a compiled program without loops around any."""
    found: dict[str, int] = {}
    for result, kind in _COLLECTIVE.findall(program):
        arrays = _ARRAY.findall(result)
        size = sum(
            int(bits or 8) // 8 * math.prod(map(int, filter(None, shape.split(",")))) for _, bits, shape in arrays
        )
        found[kind] = found.get(kind, 0) + size
    return found


def sent(collectives: dict[str, int], devices: int) -> float:
    """Bytes that a device sends in rings: all-reduce twice (n - 1) / n of its array, the others once."""
    twice = {"all-reduce": 2}
    return sum(twice.get(kind, 1) * size for kind, size in collectives.items()) * (devices - 1) / devices


def on_paper() -> dict[str, dict[str, float]]:
    """Seconds a step that the full-size network's gradient takes over each link, if nothing hides them: one all-reduce
    of all that is trained, as counted of the small network, float32."""
    size = 4 * count(dit_shapes(WanConfig().dit))
    return {name: {str(n): 2 * size * (n - 1) / n / rate for n in (8, 32, 256)} for name, rate in LINKS.items()}


def _example(index: int) -> Example:
    rng, area = np.random.default_rng(index), (FRAMES, ROWS, 2 * ROWS)

    def values(*channels):
        return rng.random((*area, *channels), np.float32)

    clip = Clip(values(3), values(), 1 + values(), values(CANDIDATES, 3), 1 + values(CANDIDATES), np.zeros((FRAMES, 3)))
    return Example(clip, values(3), 1 + values())


def trained_by(processes: int, folder: Path) -> dict[str, float]:
    """Median steps a second, and the last loss, of the command itself with so many processes of one core each."""
    data = ExampleDataConfig(str(folder / "examples"), frames=FRAMES, held_out=2)
    output = folder / f"run{processes}"
    options = {
        "network": CONFIG.network,
        "batch": BATCH,
        "steps": STEPS,
        "evaluate_every": STEPS,
        "log_every": 1,
        "optimizer": OPTIMIZER,
    }
    recipe = folder / f"{processes}.toml"
    recipe.write_text(dump_config(LearnedTrainConfig(output=str(output), data=data, **options)))
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    command = [sys.executable, "-m", "experiments.train_restore", "--config", str(recipe)]
    joined = [["--address", address, "--processes", str(processes), "--process", str(i)] for i in range(processes)]
    flags = {"XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false", "JAX_PLATFORMS": "cpu"}
    running = [
        subprocess.Popen(command + (options if processes > 1 else []), env={**os.environ, **flags})
        for options in joined
    ]
    for process in running:
        if process.wait():
            raise RuntimeError(f"{' '.join(command)} ended with {process.returncode}")
    lines = [line for line in map(json.loads, (output / "log.jsonl").read_text().splitlines()) if "loss" in line]
    speed = statistics.median(line["steps_per_second"] for line in lines[5:])
    return {"steps_per_second": speed, "loss": lines[-1]["loss"]}


def main(arguments: list[str] | None = None) -> int:
    """Prints bytes a step by number of devices, and steps a second by number of processes."""
    parser = CommandParser("studies.machines", __doc__, "benchmarks")
    parser.add_argument("--json", metavar="FILE", help="write the figures there")
    return parser.run(_run, arguments)


def _run(options) -> None:
    jax.config.update("jax_num_cpu_devices", max(DEVICES))  # before anything touches a device
    size = 4 * count(jax.eval_shape(partial(initial_learned_state, CONFIG)).parameters)
    result = {"parameter_bytes": size, "wire": {}, "on_paper_s": on_paper(), "processes": {}}
    for sharded in (False, True):
        for devices in DEVICES:
            kinds = wire(devices, sharded=sharded)
            row = {"collectives": kinds, "sent": sent(kinds, devices)}
            result["wire"][f"{devices} {'sharded' if sharded else 'whole'}"] = row
            print(
                f"{devices} devices, {'sharded' if sharded else 'whole'} state: {row['sent'] / size:.2f} x parameters"
            )
    with tempfile.TemporaryDirectory() as folder:
        list(write_examples(Path(folder) / "examples", _example, 12))
        for processes in PROCESSES:
            result["processes"][str(processes)] = trained_by(processes, Path(folder))
            print(f"{processes} processes: {result['processes'][str(processes)]}", flush=True)
            if options.json:
                write_text(Path(options.json), json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    sys.exit(main())
