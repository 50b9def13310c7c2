"""The picture of `studies.compact`: decibels over bytes, a line a format and a way to make a scene smaller."""

import io
from pathlib import Path

from experiments.evaluate.pareto import pareto_front
from rein3d_jax.io.files.atomic import write_bytes

_COLOURS = ("#c8553d", "#1f7a8c", "#8a7a2a", "#6a5acd", "#2d6a4f", "#b5179e", "#e09f3e")


def rows_of_front(rows: list[dict]) -> list[dict]:
    """Of the rows that have a PSNR those that no smaller one reaches, smallest first."""
    known = [row for row in rows if "psnr" in row]
    return [known[i] for i in pareto_front([(row["bytes"][0], row["psnr"][0]) for row in known])]


def draw_compact(rows: list[dict], path: Path) -> None:
    """Writes the PNG: formats on the left, ways on the right."""
    from matplotlib.figure import Figure  # of the bench extra; the numbers need none

    sheet = Figure(figsize=(9.5, 3.8), layout="constrained")
    left, right = sheet.subplots(1, 2, sharey=True)
    lifted = rows[0]["way"]
    _lines(left, {row["format"]: [] for row in rows}, [row for row in rows if row["way"] == lifted], "format")
    front = rows_of_front(rows)
    left.plot(
        *zip(*((row["bytes"][0], row["psnr"][0]) for row in front), strict=True), color="0.8", linewidth=6, zorder=0
    )
    _lines(right, {row["way"]: [] for row in rows}, [row for row in rows if row["format"] == "ply"], "way")
    for panel, title in ((left, "written and read back"), (right, "made smaller, as PLY")):
        panel.set(xscale="log", xlabel="bytes", title=title)
        panel.legend(fontsize=7, frameon=False)
    left.set_ylabel("PSNR at novel views, dB")
    stream = io.BytesIO()
    sheet.savefig(stream, format="png", dpi=100, metadata={"Software": None})
    write_bytes(path, stream.getvalue())


def _lines(panel, found: dict[str, list[dict]], rows: list[dict], key: str) -> None:
    for row in rows:
        if "psnr" in row:
            found[row[key]].append(row)
    if key == "way":  # all of them begin with the whole scene
        found = {way: points if points[0] is rows[0] else [rows[0], *points] for way, points in found.items()}
    for colour, (name, points) in zip(_COLOURS, found.items(), strict=False):
        bytes_, psnr = ([row[figure][0] for row in points] for figure in ("bytes", "psnr"))
        panel.errorbar(bytes_, psnr, color=colour, marker="o", markersize=3, linewidth=1, label=name)
