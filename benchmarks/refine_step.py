"""A refinement step beside its peers: forward, gradient of the mean squared error, and Adam's update of every leaf.

Each engine in its own process, taking turns in one run. Memory counts what compilation took.
"""

import importlib.util
import json
import statistics
from pathlib import Path

from benchmarks.engines.worker import INSTALL, Worker
from benchmarks.rasterize import turn
from benchmarks.workloads import SIZES
from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import write_text

OURS = "rein3d_jax"
PEERS = ("gsplat-torch-vectorised", "gsplat-torch")


def measure(names: list[str], rounds: int) -> list[dict]:
    """A row for each workload and engine: median seconds of a step, bytes a Gaussian by which the process grew at most,
    and both as ratios to ours, the medians over rounds."""
    rows = []
    for name in names:
        workers = {engine: Worker(engine, name) for engine in (OURS, *PEERS)}
        times = {engine: [] for engine in workers}
        for _ in range(rounds):
            for engine, worker in workers.items():
                times[engine].append(turn(worker, "step"))
        grown = {engine: worker.close() / SIZES[name].count for engine, worker in workers.items()}
        rows += [_row(name, engine, times, grown) for engine in workers]
    return rows


def _row(name: str, engine: str, times: dict, grown: dict) -> dict:
    wall, cpu = (statistics.median(column) for column in zip(*times[engine], strict=True))
    ratios = [
        statistics.median(theirs[i] / ours[i] for theirs, ours in zip(times[engine], times[OURS], strict=True))
        for i in (0, 1)
    ]
    return {"workload": name, "engine": engine, "step_s": wall, "step_cpu_s": cpu, "wall_ratio": ratios[0],
            "cpu_ratio": ratios[1], "bytes_per_gaussian": grown[engine],
            "bytes_ratio": grown[engine] / grown[OURS]}  # fmt: skip


def main(options) -> int:
    """`python -m benchmarks refine_step`."""
    names = options.workloads.split(",")
    for name in names:
        if name not in SIZES:
            raise InputError(f"--workloads {name} is none of {', '.join(SIZES)}")
    if options.rounds < 1:
        raise InputError("--rounds must be at least 1")
    if not all(importlib.util.find_spec(package) for package in ("torch", "gsplat")):
        raise InputError(f"refine_step needs torch and gsplat: {INSTALL[PEERS[0]]}")
    rows = measure(names, options.rounds)
    for row in rows:
        print(f"{row['workload']} {row['engine']:24} {1e3 * row['step_s']:8.0f} ms  {row['wall_ratio']:6.1f} x our time"
              f"  {row['bytes_per_gaussian']:8.0f} bytes a Gaussian")  # fmt: skip
    if options.json:
        write_text(Path(options.json), json.dumps(rows, indent=1) + "\n")
    return 0
