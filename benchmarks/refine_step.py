"""Seconds and bytes of a refinement step beside its peers.

A step is the forward pass, the gradient of the mean squared error, and Adam's update of every leaf. Every engine runs
in its own process, one after another in each round. Memory counts what compilation took.
"""

import importlib.util
import json
import statistics
import sys
from pathlib import Path

from benchmarks.engines.worker import INSTALL, Worker
from benchmarks.rasterize import add_rounds, names_among, timed_calls
from benchmarks.workloads import SIZES
from experiments.command import CommandParser
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
                times[engine].append(timed_calls(worker, "step"))
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


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0, or 2 with one line on stderr where an argument is at fault."""
    parser = CommandParser("refine_step", __doc__, "benchmarks")
    add_rounds(parser)
    return parser.run(_run, arguments)


def _run(options) -> None:
    names = names_among(SIZES, options.workloads, "workloads")
    if options.rounds < 1:
        raise InputError(f"--rounds {options.rounds} must be at least 1")
    if not all(importlib.util.find_spec(package) for package in ("torch", "gsplat")):
        raise InputError(f"refine_step needs torch and gsplat: {INSTALL[PEERS[0]]}")
    rows = measure(names, options.rounds)
    for row in rows:
        print(f"{row['workload']} {row['engine']:24} {1e3 * row['step_s']:8.0f} ms  {row['wall_ratio']:6.1f} x our time"
              f"  {row['bytes_per_gaussian']:8.0f} bytes a Gaussian")  # fmt: skip
    if options.json:
        write_text(Path(options.json), json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    sys.exit(main())
