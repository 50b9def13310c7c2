"""A chart of the automatic choice beside the grid it stands for: PSNR against seconds, a point a row of studies.scene.

python -m benchmarks.studies.choice_chart [benchmarks/results/scene_choice.json] [--png FILE]
"""

import io
import sys
from pathlib import Path

from matplotlib.figure import Figure

from experiments.command import CommandParser
from rein3d_jax.io.files.atomic import write_bytes
from rein3d_jax.io.files.json_file import read_json

RESULT = "benchmarks/results/scene_choice.json"
CLOSE = 0.1  # dB below the best point, within which the automatic choice should land
COLOURS = {"0.25": "tab:blue", "0.5": "tab:orange", "1.0": "tab:green"}
MARKERS = {"2": "v", "4": "s", "8": "o"}


def draw(rows: dict[str, dict], rooms: int) -> bytes:
    """PNG of `rows` (name -> psnr [mean, error], seconds)."""
    figure = Figure(figsize=(6.4, 4.0), dpi=110, layout="constrained")
    axis = figure.subplots()
    grid = {name: row for name, row in rows.items() if name != "automatic"}
    best = max(row["psnr"][0] for row in grid.values())
    axis.axhspan(best - CLOSE, best, color="0.92", label=f"within {CLOSE} dB of the best")
    for name, row in grid.items():
        share, paths, steps = (part.split()[-1 if part.startswith("share") else 0] for part in name.split(", "))
        colours = {"edgecolors": COLOURS[share], "facecolors": COLOURS[share] if int(steps) else "none"}
        axis.scatter(row["seconds"], row["psnr"][0], marker=MARKERS[paths], **colours)
    chosen = rows["automatic"]
    axis.scatter(chosen["seconds"], chosen["psnr"][0], marker="*", s=180, color="tab:red", label="automatic", zorder=3)
    for share, colour in COLOURS.items():
        axis.scatter([], [], color=colour, label=f"lift.share {share}")
    for paths, marker in MARKERS.items():
        axis.scatter([], [], marker=marker, edgecolors="0.3", facecolors="none", label=f"{paths} paths")
    axis.scatter([], [], color="0.3", label="refined (open: not)")
    axis.set(xlabel="seconds of a room", ylabel="PSNR at novel views, dB", title=f"Half size, mean of {rooms} rooms")
    axis.legend(fontsize=7, loc="lower right")
    stream = io.BytesIO()
    figure.savefig(stream, format="png")
    return stream.getvalue()


def main(arguments: list[str] | None = None) -> int:
    """Reads the table, writes the picture."""
    parser = CommandParser("studies.choice_chart", __doc__, "benchmarks")
    parser.add_argument("table", nargs="?", default=RESULT, help="of `studies.scene choice` (default: %(default)s)")
    parser.add_argument("--png", metavar="FILE", help="default: beside the table")
    return parser.run(_run, arguments)


def _run(options) -> None:
    table = read_json(Path(options.table))
    picture = Path(options.png or Path(options.table).with_suffix(".png"))
    write_bytes(picture, draw(table["rows"], len(table["rooms"])))


if __name__ == "__main__":
    sys.exit(main())
