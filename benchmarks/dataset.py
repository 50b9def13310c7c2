"""Seconds to build a dataset of pairs, and whether kill -9 or several workers change its bytes.

    python -m benchmarks.dataset [--clips 64] [--json FILE]

Exit code 1 where bytes differ from those of an unbroken build by one worker.
"""

import hashlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from experiments.command import CommandParser

RECIPE = "tiny_pairs"


def main(arguments: list[str] | None = None) -> int:
    """Builds the tiny recipe's dataset four times in a temporary folder, with compiled programs kept there."""
    parser = CommandParser("dataset", __doc__, "benchmarks")
    parser.add_argument("--clips", type=int, default=64, help="of the dataset (%(default)s)")
    parser.add_argument("--json", metavar="FILE", type=Path, help="write the figures there")
    return parser.run(_run, arguments)


def _run(options) -> int:
    with tempfile.TemporaryDirectory() as folder:
        os.environ["JAX_COMPILATION_CACHE_DIR"] = f"{folder}/cache"
        figures = measure(Path(folder), options.clips)
    print(json.dumps(figures, indent=1))
    if options.json:
        options.json.write_text(json.dumps(figures, indent=1) + "\n")
    return 0 if figures["same_after_kill"] and figures["same_with_3_workers"] and figures["same_with_ray"] else 1


def measure(folder: Path, clips: int) -> dict:
    """Seconds of the first build (compilation in them), and whether the others have its bytes."""
    begun = time.perf_counter()
    _build(folder / "one", clips).wait()
    seconds = time.perf_counter() - begun
    begun = time.perf_counter()
    _build(folder / "again", clips).wait()
    warm = time.perf_counter() - begun
    for _ in range(2):
        process = _build(folder / "killed", clips)
        time.sleep(0.4 * warm)
        process.send_signal(signal.SIGKILL)
        process.wait()
    _build(folder / "killed", clips).wait()
    for process in [_build(folder / "three", clips, "--worker", f"{i}/3") for i in range(3)]:
        process.wait()
    _build(folder / "ray", clips, "--ray", "2").wait()
    one = _bytes(folder / "one")
    return {
        "clips": clips,
        "cores": len(os.sched_getaffinity(0)),
        "seconds_with_compilation": round(seconds, 1),
        "seconds_compiled_before": round(warm, 1),
        "files": len(one),
        "same_after_kill": _bytes(folder / "killed") == one,
        "same_with_3_workers": _bytes(folder / "three") == one,
        "same_with_ray": _bytes(folder / "ray") == one,
    }


def _build(output: Path, clips: int, *options: str) -> subprocess.Popen:
    settings = ("--set", f"output={output}", "--set", f"clips={clips}")
    command = [sys.executable, "-m", "experiments.build_dataset", "--config", RECIPE, *settings, *options]
    return subprocess.Popen(command, stdout=sys.stderr)


def _bytes(folder: Path) -> dict[str, str]:
    """The hash of every file there, those left behind included."""
    files = sorted(folder.iterdir())
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


if __name__ == "__main__":
    sys.exit(main())
