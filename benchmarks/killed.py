"""A job killed at random moments and resumed has the bytes of one that nobody killed.

The kernel kills it (SIGKILL) after CPU seconds drawn evenly from those of an unbroken job, then --resume, and what came
of it is compared. Two unbroken ones come first: one fills a folder of compiled programs, the other says what it takes
then.

    python -m benchmarks.killed --recipe quick --count 20 --json benchmarks/results/killed.json
"""

import hashlib
import json
import os
import random
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from experiments.command import CommandParser
from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import write_text

FILES = ("scene.ply", "viewer.html", "flythrough.mp4")
_SOONEST = 3  # CPU seconds in which Python starts


def run_until(cpu_seconds: int, output: Path, programs: Path, *arguments: str) -> int:
    """The exit code of a job in a process of its own; -9 where it took so many CPU seconds, and was killed."""
    command = [sys.executable, "-m", "experiments.reconstruct", "--output", str(output), *arguments]
    environment = {**os.environ, "JAX_COMPILATION_CACHE_DIR": str(programs)}
    process = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL)
    resource.prlimit(process.pid, resource.RLIMIT_CPU, (cpu_seconds, cpu_seconds))
    return process.wait()


def digests(output: Path) -> dict[str, str]:
    """Of FILES, as far as they are there."""
    there = (output / name for name in FILES if (output / name).exists())
    return {file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in there}


def unbroken(recipe: str, folder: Path) -> tuple[dict[str, str], int]:
    """What a job makes that nobody kills, and the CPU seconds that it takes once its programs are kept. Raises
    InputError where it fails, or makes other bytes the second time."""
    made = []
    for name in ("first", "second"):
        code = run_until(resource.RLIM_INFINITY, folder / name, folder / "programs", "--config", recipe)
        made.append(digests(folder / name))
    if code or len(made[0]) < len(FILES) or made[0] != made[1]:
        raise InputError(f"--recipe {recipe} fails, or makes other bytes each time: see to that first")
    return made[0], round(json.loads((folder / "second" / "metrics.json").read_text("utf-8"))["cpu_seconds"])


def trial(recipe: str, folder: Path, cpu_seconds: int) -> dict:
    """What became of a job that was killed after so many: the stages it left, its exit code, that of the resumed one,
    and the digests of what that made."""
    with tempfile.TemporaryDirectory(dir=folder) as name:
        room, programs = Path(name) / "room", folder / "programs"
        code = run_until(cpu_seconds, room, programs, "--config", recipe)
        left = sorted(file.stem for file in (room / "stages").glob("[!.]*.npz"))
        resumed = run_until(resource.RLIM_INFINITY, room, programs, "--config", recipe, "--resume")
        made = digests(room)
    return {"after_cpu_s": cpu_seconds, "exit": code, "left": left, "resumed_exit": resumed, "made": made}


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0, or 1 where bytes differ."""
    parser = CommandParser("killed", __doc__, "benchmarks")
    parser.add_argument("--recipe", default="quick", help="default: %(default)s")
    parser.add_argument("--count", type=int, default=20, metavar="N", help="of kills (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the moments (default: %(default)s)")
    parser.add_argument("--json", metavar="FILE", help="write what came of it there")
    return parser.run(_run, arguments)


def _run(options) -> int:
    if options.count < 1:
        raise InputError(f"--count {options.count} must be at least 1")
    chance, trials = random.Random(options.seed), []
    with tempfile.TemporaryDirectory() as name:
        whole, seconds = unbroken(options.recipe, Path(name))
        print(f"unbroken: {seconds} CPU s", flush=True)
        for _ in range(options.count):
            found = trial(options.recipe, Path(name), chance.randint(_SOONEST, seconds))
            trials.append(found | {"same": found.pop("made") == whole})
            print(trials[-1], flush=True)
            report = {"recipe": options.recipe, "files": FILES, "unbroken_cpu_s": seconds, "trials": trials}
            if options.json:  # so far: an hour's work
                write_text(Path(options.json), json.dumps(report, indent=1) + "\n")
    return 0 if all(row["same"] for row in trials) else 1


if __name__ == "__main__":
    sys.exit(main())
