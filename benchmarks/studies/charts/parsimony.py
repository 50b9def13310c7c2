"""The picture of `studies.parsimony`: Gaussians, and CPU seconds, against what stands in a room."""

import io
from pathlib import Path

import numpy as np

from rein3d_jax.io.files.atomic import write_bytes

_COLOURS = ("#c8553d", "#6a5acd", "#1f7a8c")


def draw_parsimony(table: dict[str, dict], path: Path) -> None:
    """Writes the PNG of a table: series -> its rooms."""
    from matplotlib.figure import Figure  # of the bench extra; the numbers need none

    sheet = Figure(figsize=(9.0, 3.6), layout="constrained")
    left, right = sheet.subplots(1, 2)
    for colour, (name, series) in zip(_COLOURS, table.items(), strict=True):
        rooms = series["rooms"]
        edges, pieces = (np.array([row[key] for row in rooms], float) for key in ("edges", "pieces"))
        count = np.array([row["observed"] + row["behind"] for row in rooms]) / 1000
        line = series["gaussians by"]["edges"]
        left.scatter(edges, count, s=14, color=colour, label=name)
        ends = np.array([edges.min(), edges.max()])
        left.plot(ends, (line["at none"] + line["slope"] * ends) / 1000, color=colour, linewidth=1)
        cpu = np.array([sum(row["cpu"].values()) for row in rooms])
        right.scatter(pieces, cpu, s=14, color=colour, label=name)
        means = sorted({piece: cpu[pieces == piece].mean() for piece in pieces}.items())
        right.plot(*zip(*means, strict=True), color=colour, linewidth=1)
    left.set(xlabel="depth edges, radians", ylabel="Gaussians, thousands", ylim=(0, None))
    right.set(xlabel="pieces of furniture", ylabel="CPU seconds, compiled before", ylim=(0, None))
    left.legend(fontsize=8, frameon=False)
    stream = io.BytesIO()
    sheet.savefig(stream, format="png", dpi=100, metadata={"Software": None})
    write_bytes(path, stream.getvalue())
