"""One page of small multiples: every regime's figure over severity, ours and the peers, the breaking points."""

import importlib.util
import io
import itertools
from pathlib import Path

import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import write_bytes

_COLUMNS = 6
_COLOURS = {
    "ours": "#c8553d", "balls": "#555b6e", "mesh": "#1f7a8c", "telea": "#8a7a2a", "box": "#6a5acd",
}  # fmt: skip
_OTHERS = ("#2d6a4f", "#b5179e", "#e09f3e", "#4a4e69")


def require_drawing() -> None:
    """Raises InputError without matplotlib: to be asked before the long part."""
    if importlib.util.find_spec("matplotlib") is None:
        raise InputError('--picture draws with matplotlib: pip install "rein3d-jax[bench]"')


def draw_page(table: dict[str, dict], path: Path) -> None:
    """Writes the page as PNG."""
    from matplotlib.figure import Figure as Sheet  # of the bench extra; the numbers need none

    rows = -(-len(table) // _COLUMNS)
    sheet = Sheet(figsize=(3.1 * _COLUMNS, 2.5 * rows), layout="constrained")
    panels = sheet.subplots(rows, _COLUMNS, squeeze=False).ravel()
    for panel, (name, row) in zip(panels, table.items(), strict=False):
        _panel(panel, name, row)
    for panel in panels[len(table) :]:
        panel.set_axis_off()
    buffer = io.BytesIO()
    sheet.savefig(buffer, format="png", dpi=80, metadata={"Software": None})
    write_bytes(path, buffer.getvalue())


def _panel(panel, name: str, row: dict) -> None:
    others = iter(_OTHERS * 3)
    places = range(len(row["severities"]))
    for method, figures in row["curves"].items():
        if row["figure"] not in figures:
            continue
        mean, error = np.array(figures[row["figure"]], float).T  # None becomes NaN: no point
        colour = _COLOURS.get(method) or next(others)
        style = {"linewidth": 2.0 if method == "ours" else 1.0, "zorder": 3 if method == "ours" else 2}
        panel.errorbar(places, mean, yerr=error, color=colour, label=method, capsize=1.5, **style)
    for at in row["breaks_at"]:
        if at is not None:
            panel.axvline(_place(at, row["severities"]), color="0.6", linestyle=":", linewidth=1)
    panel.set_title(name, fontsize=9)
    panel.set_xlabel(row["axis"], fontsize=7)
    panel.set_ylabel(row["label"], fontsize=6)
    panel.set_xticks(list(places), [f"{x:g}" for x in row["severities"]], fontsize=6)
    panel.tick_params(axis="y", labelsize=6)
    panel.legend(fontsize=5, frameon=False)


def _place(at: float, severities: list[float]) -> float:
    """Where a severity stands on an axis of evenly spaced points."""
    for i, (a, b) in enumerate(itertools.pairwise(severities)):
        if a <= at <= b:
            return i + (at - a) / (b - a)
    return 0.0
