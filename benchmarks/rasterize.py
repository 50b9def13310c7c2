"""Seconds of our rasterizer beside its peers.

Every engine runs in its own process, one after another in each round.

Peers: the prototype that the project began with, re-made from its description, and gsplat's torch reference, as it is
and with its slowest part, a Python loop, replaced. PyPI has
no pure-JAX splatting package that runs on a CPU (splax 0.2.3 needs CUDA: its kernels are NVIDIA Warp's).
"""

import importlib.util
import json
import statistics
import sys
from collections.abc import Iterable
from pathlib import Path

from benchmarks.engines.worker import ENGINES, INSTALL, ON_CPU, Worker
from benchmarks.workloads import SIZES
from experiments.command import CommandParser
from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import write_text

ENOUGH = 0.3  # seconds of one engine in a round; short calls repeat


def measure(names: list[str], engines: list[str], rounds: int) -> dict:
    """{"rows": one for each workload and engine, "ratios": medians over rounds of wall seconds against ours}."""
    result = {"rows": [], "ratios": [], "skipped": {}}
    for engine in list(engines):
        if engine in INSTALL and not all(importlib.util.find_spec(x) for x in ("torch", "gsplat")):
            result["skipped"][engine] = INSTALL[engine]
            engines = [name for name in engines if name != engine]
    for name in names:
        rows, ratios = _one_workload(name, engines, rounds)
        result["rows"] += rows
        result["ratios"] += ratios
    return result


def _one_workload(name, engines, rounds):
    workers = {engine: Worker(engine, name) for engine in engines}
    times = {(engine, what): [] for engine in engines for what in ("forward", "gradient")}
    for _ in range(rounds):
        for what in ("forward", "gradient"):
            for engine, worker in workers.items():
                times[engine, what].append(timed_calls(worker, what))
    parts = {engine: _shares(worker) for engine, worker in workers.items()}
    rows = [_row(name, engine, worker, times, parts[engine]) for engine, worker in workers.items()]
    ours = "rein3d_jax"
    peers = [engine for engine in engines if ours in engines and engine != ours]
    ratios = [{what: _ratio(times, engine, ours, what) for what in ("forward", "gradient")} for engine in peers]
    ratios = [{"workload": name, "engine": engine} | ratio for engine, ratio in zip(peers, ratios, strict=True)]
    return rows, ratios


def timed_calls(worker: Worker, what: str) -> tuple[float, float]:
    """Median (wall, CPU) seconds of one engine in a round, after a warm-up call."""
    first = worker.ask(what)[0][0]
    samples = worker.ask(what, max(1, min(15, int(ENOUGH / first))))
    return tuple(statistics.median(column) for column in zip(*samples, strict=True))


def _ratio(times, engine, ours, what):
    pairs = zip(times[engine, what], times[ours, what], strict=True)
    return statistics.median(theirs[0] / mine[0] for theirs, mine in pairs)


def _shares(worker):
    """Each part's share of their sum."""
    seconds = {part: statistics.median(wall for wall, _ in worker.ask(part, 7)) for part in worker.facts["parts"]}
    return {part: value / sum(seconds.values()) for part, value in seconds.items()}


def _row(name, engine, worker, times, shares):
    facts = {key: value for key, value in worker.facts.items() if key != "parts"}
    row = {"workload": name, "engine": engine}
    for what in ("forward", "gradient"):
        wall, cpu = (statistics.median(column) for column in zip(*times[engine, what], strict=True))
        row |= {f"{what}_s": wall, f"{what}_cpu_s": cpu}
    if "evaluations" in facts:
        row["forward_ns_per_evaluation"] = 1e9 * row["forward_s"] / facts["evaluations"]
    return row | {"peak_bytes": worker.close()} | facts | ({"shares": shares} if shares else {})


def table(result: dict) -> str:
    """What a person reads."""
    heads = "".join(f"{what:>10}{'cpu/wall':>9}" for what in ("forward", "gradient"))
    lines = [f"{'':2} {'engine':24}{heads}{'compile':>9}{'peak':>8}"]
    for row in result["rows"]:
        seconds = "".join(
            f"{1e3 * row[f'{what}_s']:8.0f}ms{row[f'{what}_cpu_s'] / row[f'{what}_s']:9.2f}"
            for what in ("forward", "gradient")
        )
        rest = f"{row['compile_s']:8.1f}s{row['peak_bytes'] / 2**20:5.0f}MiB"
        lines.append(f"{row['workload']:2} {row['engine']:24}{seconds}{rest}")
        if "shares" in row:
            lines.append("   " + ", ".join(f"{part} {share:.0%}" for part, share in row["shares"].items()))
    for ratio in result["ratios"]:
        lines.append(
            f"{ratio['workload']:2} {ratio['engine']} takes {ratio['forward']:.1f} x our time for a picture, "
            f"{ratio['gradient']:.1f} x with the gradient"
        )
    return "\n".join(lines + [f"{name} skipped: {how}" for name, how in result["skipped"].items()])


def names_among(known: Iterable[str], text: str, option: str) -> list[str]:
    """The comma-separated names in `text`. Raises InputError for one that is not `known`."""
    names = text.split(",")
    for name in names:
        if name not in known:
            raise InputError(f"--{option} {name} is none of {', '.join(known)}")
    return names


def add_rounds(parser: CommandParser) -> None:
    """--workloads, --rounds and --json."""
    parser.add_argument("--workloads", default=",".join(SIZES), metavar="A,B", help="default: all of %(default)s")
    parser.add_argument("--rounds", type=int, default=5, metavar="N", help="(default: %(default)s)")
    parser.add_argument("--json", metavar="FILE", help="write the figures there")


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0, or 2 with one line on stderr where an argument is at fault."""
    parser = CommandParser("rasterize", __doc__, "benchmarks")
    add_rounds(parser)
    parser.add_argument("--engines", default=",".join(ON_CPU), metavar="A,B",
                        help=f"of {', '.join(ENGINES)} (default: %(default)s)")  # fmt: skip
    return parser.run(_run, arguments)


def _run(options) -> None:
    names = names_among(SIZES, options.workloads, "workloads")
    engines = names_among(ENGINES, options.engines, "engines")
    if options.rounds < 1:
        raise InputError(f"--rounds {options.rounds} must be at least 1")
    result = measure(names, engines, options.rounds)
    print(table(result))
    if options.json:
        write_text(Path(options.json), json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    sys.exit(main())
