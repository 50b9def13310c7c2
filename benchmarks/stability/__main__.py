"""Where methods of this kind fail: regimes by degrees of severity, ours beside peers.

    python -m benchmarks.stability [--regimes "blurred distance,mirror"] [--quick] [--json FILE] [--picture PNG]

Each regime has a severity axis, the figure that shows the failure, and its mean with standard error over seeds. Ours
breaks where the figure is worse than at the mild end by the figure's tolerance (3 dB of PSNR, 0.05 of a share), and is
behind a peer where that is better by more than the standard error of the difference. Regimes that FILE already holds
stay, unless they are measured again.
"""

import json
import sys
import time
from pathlib import Path

from benchmarks.stability import (
    given_distance,
    given_picture,
    materials,
    needles,
    optimising,
    photo_alone,
    places,
    rendering,
    restoring,
)
from benchmarks.stability.curve import lines_of, readings_of, table_of
from benchmarks.stability.page import draw_page, require_drawing
from benchmarks.stability.regime import Regime
from experiments.command import CommandParser
from experiments.compiled_programs import forget_when_many
from experiments.quick_process import begin_quickly
from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.io.files.json_file import read_json

PARTS = (given_distance, given_picture, photo_alone, places, materials, rendering, needles, restoring, optimising)
REGIMES: dict[str, Regime] = {regime.name: regime for part in PARTS for regime in part.REGIMES}


def main(arguments: list[str] | None = None) -> int:
    """Prints the table. Exit code 0, or 2 where a regime is unknown."""
    begin_quickly()
    parser = CommandParser("stability", __doc__, "benchmarks")
    parser.add_argument("--regimes", metavar="A,B", help='some of them; "none" only draws what FILE holds')
    parser.add_argument("--quick", action="store_true", help="one seed, at the mild end and the outermost severities")
    parser.add_argument("--json", metavar="FILE", type=Path, help="write the figures there, as they come")
    parser.add_argument("--picture", metavar="PNG", type=Path, help="draw all regimes on one page")
    return parser.run(_run, arguments)


def _run(options) -> None:
    chosen = _chosen(options.regimes)
    if options.picture:
        require_drawing()
    table = read_json(options.json) if options.json and options.json.exists() else {}
    for name in chosen:
        started, used = time.perf_counter(), time.process_time()
        regime = REGIMES[name]
        row = table_of(regime, readings_of(regime, quick=options.quick), quick=options.quick)
        spent = {"seconds": round(time.perf_counter() - started, 1), "cpu": round(time.process_time() - used, 1)}
        table[name] = row | spent
        print(name, spent, "breaks at", row["breaks_at"], "behind", row["behind"], flush=True)
        table = {known: table[known] for known in REGIMES if known in table}
        if options.json:
            rows = ",\n".join(f"{json.dumps(known)}: {json.dumps(row)}" for known, row in table.items())
            write_text(options.json, f"{{\n{rows}\n}}\n")
        forget_when_many()
    print("\n".join(lines_of(table)))
    if options.picture:
        draw_page(table, options.picture)


def _chosen(names: str | None) -> list[str]:
    if names == "none":
        return []
    wanted = list(REGIMES) if names is None else [name.strip() for name in names.split(",")]
    for name in wanted:
        if name not in REGIMES:
            raise InputError(f'--regimes: "{name}" is none of {", ".join(REGIMES)}')
    return wanted


if __name__ == "__main__":
    sys.exit(main())
