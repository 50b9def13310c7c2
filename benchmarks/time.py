"""What the main job takes, as a user meets it: whole processes, the first on a machine and the ones after it.

CPU seconds (user and system) of each, wall seconds, seconds until viewer.html is first there, and by stage how much
went into tracing, compiling and the work itself; medians over rounds. `--beside` runs another checkout of the project
in turn, `--rows` a photo at several sizes, with the slopes of what grows and, with `--chart`, a picture of it.

    python -m benchmarks.time --json benchmarks/results/time.json [--recipes quick,draft] [--beside FOLDER]
    python -m benchmarks.time --photo pano.jpg --rows 128,256,512,1024,2048 --json FILE.json --chart FILE.png
"""

import io
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from experiments.command import CommandParser
from experiments.evaluate.chart import check_charts
from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import write_bytes, write_text

HERE = Path(__file__).resolve().parents[1]
RUNS = ("first", "second")  # on a machine
GROWING = ("cpu_s", "peak_bytes", "viewer_bytes")
CHARTED = {"cpu_s": "CPU seconds", "wall_s": "seconds", "peak_bytes": "GB of memory", "viewer_bytes": "MB of page"}
FORESEEN = {"wall_s": "foreseen_s", "peak_bytes": "foreseen_bytes"}
_UNITS = {"peak_bytes": 1e-9, "foreseen_bytes": 1e-9, "viewer_bytes": 1e-6}
_LOOK = 0.1  # seconds between looks for viewer.html


def run_job(project: Path, cache: Path, *arguments: str) -> dict:
    """One job of the project's in a process of its own, with the compiled programs in `cache`. Raises RuntimeError with
    what it said where it fails."""
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder) / "run"
        command = [sys.executable, "-m", "experiments.reconstruct", "--output", str(output), *arguments]
        environment = {**os.environ, "JAX_COMPILATION_CACHE_DIR": str(cache)}
        before, started, seen = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter(), None
        process = subprocess.Popen(
            command, cwd=project, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        while process.poll() is None:
            if seen is None and (output / "viewer.html").exists():
                seen = time.perf_counter() - started
            time.sleep(_LOOK)
        wall, after = time.perf_counter() - started, resource.getrusage(resource.RUSAGE_CHILDREN)
        if process.returncode:
            raise RuntimeError(process.stdout.read())
        metrics = json.loads((output / "metrics.json").read_text())
        viewer = (output / "viewer.html").stat().st_size
    cpu = sum(getattr(after, of) - getattr(before, of) for of in ("ru_utime", "ru_stime"))
    found = {"cpu_s": cpu, "wall_s": wall, "first_viewer_s": wall if seen is None else seen}
    found |= {"gaussians": metrics["count"]["refined"], "viewer_bytes": viewer}
    found |= {of: metrics[of] for of in ("peak_bytes", "foreseen_bytes") if of in metrics}
    found |= {"psnr": metrics["quality"]["refined"]["psnr"]} if "quality" in metrics else {}
    return found | {"stages": _by_stage(metrics), "foreseen_s": metrics.get("foreseen_seconds", {}).get("total")}


def _by_stage(metrics: dict) -> dict[str, dict[str, float]]:
    """Seconds of each stage, and of these for tracing and for compiling, where the job tells."""
    programs = metrics.get("program_seconds", {})
    parts = {"seconds": metrics["seconds"], **programs}
    return {stage: {part: of[stage] for part, of in parts.items() if stage in of} for stage in metrics["seconds"]}


def measure(projects: dict[str, Path], jobs: dict[str, list[str]], rounds: int, runs: tuple[str, ...] = RUNS) -> dict:
    """{project: {job: {run}}}: medians over rounds, the projects in turn; a round's first job of each kind begins with
    an empty cache."""
    found: dict = {name: {job: {run: [] for run in runs} for job in jobs} for name in projects}
    for _ in range(rounds):
        for job, arguments in jobs.items():
            for name, project in projects.items():
                with tempfile.TemporaryDirectory() as cache:
                    for turn in runs:
                        row = run_job(project, Path(cache), *arguments)
                        found[name][job][turn].append(row)
                        print(f"{name:10} {job:14} {turn:7} {_line(row)}", flush=True)
    return {n: {j: {t: _median(rows) for t, rows in of.items()} for j, of in by.items()} for n, by in found.items()}


def _line(row: dict) -> str:
    took = f"{row['cpu_s']:6.1f} CPU s, {row['wall_s']:6.1f} s, first viewer after {row['first_viewer_s']:5.1f} s"
    return f"{took}, {row['peak_bytes'] / 1e9:.1f} GB, {row['gaussians']:,.0f} Gaussians"


def _median(rows: list[dict]) -> dict:
    """Of figures alike in shape, the median of each number."""
    if isinstance(rows[0], dict):
        return {key: _median([row[key] for row in rows]) for key in rows[0]}
    return None if rows[0] is None else round(statistics.median(rows), 4)


def growth(by_rows: dict[int, dict]) -> dict[str, float]:
    """What grows with the pixels, and with the Gaussians: slopes of straight lines through the logarithms."""
    pixels, rows = [2.0 * number**2 for number in by_rows], list(by_rows.values())
    gaussians = [row["gaussians"] for row in rows]

    def slope(of: str, against: list[float]) -> float:
        return round(float(np.polyfit(np.log(against), np.log([row[of] for row in rows]), 1)[0]), 3)

    with_pixels = {f"{of} / pixels": slope(of, pixels) for of in (*GROWING, "gaussians")}
    return with_pixels | {f"{of} / gaussians": slope(of, gaussians) for of in GROWING}


def growth_chart(by_rows: dict[int, dict]) -> bytes:
    """PNG: what a job took by its pixels and by its Gaussians, both axes logarithmic; dashed, what was foreseen."""
    from matplotlib.figure import Figure

    figure, slopes = Figure(figsize=(12, 4.6), dpi=110, layout="constrained"), growth(by_rows)
    rows = list(by_rows.values())
    across = {"pixels": [2 * number**2 for number in by_rows], "gaussians": [row["gaussians"] for row in rows]}
    for axis, (name, places) in zip(figure.subplots(1, 2, sharey=True), across.items(), strict=True):
        for index, (of, label) in enumerate(CHARTED.items()):
            slope = f", slope {slopes[key]:.2f}" if (key := f"{of} / {name}") in slopes else ""
            colour, unit = f"C{index}", _UNITS.get(of, 1.0)
            axis.loglog(places, [unit * row[of] for row in rows], "o-", color=colour, label=label + slope)
            if of in FORESEEN:
                foreseen = [unit * row[FORESEEN[of]] for row in rows]
                axis.loglog(places, foreseen, "--", color=colour, label=f"{label}, foreseen")
        axis.set(xlabel=f"{name} (slope of Gaussians over pixels {slopes['gaussians / pixels']:.2f})")
        axis.grid(visible=True, color="0.9")
        axis.legend(fontsize=8)
    stream = io.BytesIO()
    figure.savefig(stream, format="png", metadata={"Software": None})
    return stream.getvalue()


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0, or 2 with one line on stderr where an argument is at fault."""
    parser = CommandParser("time", __doc__, "benchmarks")
    parser.add_argument("--recipes", default="quick,draft", metavar="A,B", help="default: %(default)s")
    parser.add_argument("--rounds", type=int, default=3, metavar="N", help="default: %(default)s")
    parser.add_argument("--beside", metavar="FOLDER", help="another checkout of the project, run in turn")
    parser.add_argument("--photo", metavar="FILE", help="instead of the recipes: quick with this panorama, by --rows")
    parser.add_argument("--rows", default="128,256,512,1024", metavar="A,B", help="working rows (default: %(default)s)")
    parser.add_argument("--runs", type=int, default=2, choices=(1, 2), help="1 leaves the second of each job out")
    parser.add_argument("--json", metavar="FILE", help="write the figures there")
    parser.add_argument("--chart", metavar="FILE", help="draw the growth of a --photo's first jobs there, as PNG")
    return parser.run(_run, arguments)


def _run(options) -> None:
    if options.rounds < 1:
        raise InputError(f"--rounds {options.rounds} must be at least 1")
    jobs = {name: ["--config", name] for name in options.recipes.split(",")}
    if options.photo:
        photo = ["--input", str(Path(options.photo).resolve()), "--set"]
        jobs = {f"{rows} rows": [*photo, f"input.height={rows}"] for rows in options.rows.split(",")}
    if options.chart:
        check_charts()
        if len(jobs) < 2 or not options.photo:
            raise InputError("--chart draws how a job grows: give a --photo, and several --rows")
    projects = {"this": HERE} | ({"beside": Path(options.beside)} if options.beside else {})
    found = measure(projects, jobs, options.rounds, RUNS[: options.runs])
    for name, of_jobs in found.items():
        for job, turns in of_jobs.items():
            for turn, row in turns.items():
                print(f"{name:10} {job:14} {turn:7} {_line(row)}")
    report = {"cores": os.cpu_count(), "rounds": options.rounds} | found
    if options.photo and len(jobs) > 1:
        by_rows = {name: _by_rows(of_jobs) for name, of_jobs in found.items()}
        report["slopes"] = {n: {run: growth(rows) for run, rows in of.items()} for n, of in by_rows.items()}
        print(json.dumps(report["slopes"], indent=1))
    if options.json:
        write_text(Path(options.json), json.dumps(report, indent=1) + "\n")
    if options.chart:
        write_bytes(Path(options.chart), growth_chart(by_rows["this"]["first"]))


def _by_rows(of_jobs: dict) -> dict[str, dict[int, dict]]:
    """{run: {rows: figures}}."""
    runs = next(iter(of_jobs.values()))
    return {run: {int(job.split()[0]): turns[run] for job, turns in of_jobs.items()} for run in runs}


if __name__ == "__main__":
    sys.exit(main())
