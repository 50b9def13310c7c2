"""Damaged files, by the thousand: each is read, or refused in one line; nothing else.

Every file of a folder, by turns, has bits flipped, bytes set, lengths made absurd, parts cut out and put in. Counted
are exceptions that are no InputError, messages of more than a line, reads of more than 5 seconds, and reads that took
more than 300 MB. The same seed damages the same file in the same way.

    python -m benchmarks.fuzz --files FOLDER [--count 10000] [--first 0] --json benchmarks/results/fuzz.json
"""

import json
import random
import resource
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from experiments.command import CommandParser
from rein3d_jax import read_gaussians
from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.io.pictures.decode import read_credit
from rein3d_jax.io.pictures.distance import read_distance
from rein3d_jax.io.pictures.photo import read_photo

_SLOW, _LARGE = 5.0, 300_000  # seconds; KiB
_NUMBERS = (b"\xff\xff\xff\xff", bytes(4), b"\x7f\xff\xff\xff", b"\xff\xff\xff\x7f", b"\x00\x00\x00\x80")
_TEXTS = (b"9999999999", b"-1", b"0", b"nan", b"1e30")  # in place of a digit
_SPLATS, _ARRAYS = (".ply", ".spz", ".splat", ".ksplat", ".sog"), (".npy", ".npz", ".pfm", ".exr")


def damaged(data: bytes, seed: int) -> bytes:
    """The bytes, changed in 1 to 16 places, mostly near their beginning, where headers stand."""
    chance, changed = random.Random(seed), bytearray(data)
    for _ in range(chance.choice([1, 1, 2, 4, 16])):
        if len(changed) < 8:
            break
        at = chance.randrange(min(len(changed) - 4, chance.choice([64, 400, 2000, len(changed)])))
        match chance.randrange(7):
            case 0:
                changed[at] ^= 1 << chance.randrange(8)
            case 1:
                changed[at] = chance.choice([0, 255, 127, 128])
            case 2:
                changed[at : at + 4] = chance.choice(_NUMBERS)
            case 3:
                del changed[chance.randrange(len(changed)) :]
            case 4:
                changed[at:at] = chance.randbytes(chance.randrange(1, 20))
            case 5:
                del changed[at : at + chance.randrange(1, 20)]
            case 6:
                digits = [i for i, byte in enumerate(changed[:4000]) if 48 <= byte <= 57]
                if digits:
                    at = chance.choice(digits)
                    changed[at : at + 1] = chance.choice(_TEXTS)
    return bytes(changed)


def readers(file: Path) -> list[Callable]:
    """What would be asked to read it."""
    if file.suffix in _SPLATS:
        return [read_gaussians]
    return [read_distance, read_photo] if file.suffix in _ARRAYS else [read_photo, read_credit, read_distance]


def fault(read: Callable, file: Path) -> str | None:
    """What is wrong with how a file was read; None where it was read, "" where it was refused as it should be."""
    started, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    try:
        read(file)
        found = None
    except InputError as error:
        found = "more than a line" if "\n" in str(error) else ""
    except Exception as error:
        found = f"{type(error).__name__}: {error}"
    if time.perf_counter() - started > _SLOW:
        return "slow"
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    return f"{grown} KiB" if grown > _LARGE else found


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0, or 1 where a file was not read as it should be."""
    parser = CommandParser("fuzz", __doc__, "benchmarks")
    parser.add_argument("--files", metavar="FOLDER", required=True, help="of files to damage, with its folders")
    parser.add_argument("--count", type=int, default=10_000, metavar="N", help="default: %(default)s")
    parser.add_argument("--first", type=int, default=0, metavar="SEED", help="default: %(default)s")
    parser.add_argument("--json", metavar="FILE", help="write the figures there")
    return parser.run(_run, arguments)


def _run(options) -> int:
    warnings.simplefilter("ignore")
    files = sorted(p for p in Path(options.files).rglob("*") if p.is_file() and p.suffix not in (".md", ".py", ".json"))
    if not files:
        raise InputError(f"--files {options.files} holds no file")
    counts, faults = Counter(), []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(options.first, options.first + options.count):
            source = files[seed % len(files)]
            copy = Path(folder) / f"x{source.suffix}"
            copy.write_bytes(damaged(source.read_bytes(), seed))
            for read in readers(source):
                found = fault(read, copy)
                counts["read" if found is None else "fault" if found else "refused"] += 1
                if found:
                    faults.append({"seed": seed, "file": source.name, "reader": read.__name__, "fault": found})
                    print(faults[-1], flush=True)
    report = {"files": len(files), "damaged": options.count, "reads": dict(counts), "faults": faults}
    print(report["reads"])
    if options.json:
        write_text(Path(options.json), json.dumps(report, indent=1) + "\n")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
