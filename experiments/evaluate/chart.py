"""Charts of accuracy against cost, of every recipe and method measured on the same rooms: a PNG, and its points."""

import importlib.util
import io
import json
from dataclasses import asdict, dataclass
from pathlib import Path

from experiments.evaluate.pareto import pareto_front
from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import write_bytes, write_text
from rein3d_jax.io.files.json_file import read_json

_UNITS = {"gaussians": 1e-3, "bytes": 1e-6}
_COLOURS = (
    "#1f7a8c",
    "#c8553d",
    "#6a5acd",
    "#8a7a2a",
    "#2d6a4f",
    "#b5179e",
    "#555b6e",
    "#e09f3e",
    "#118ab2",
    "#a44a3f",
)


@dataclass(frozen=True)
class Panel:
    """Two figures of one protocol against each other."""

    protocol: str
    cost: str
    merit: str
    title: str
    cost_label: str
    merit_label: str
    more_is_better: bool = True


SECONDS, GAUSSIANS = "seconds from the panorama, log scale", "Gaussians, thousands"
CPU_SECONDS, MEGABYTES = "the processor's seconds, whole job, log scale", "megabytes of scene.ply, log scale"
PANELS = (
    Panel("novel_views", "seconds", "psnr", "Novel views", SECONDS, "PSNR, dB"),
    Panel("novel_views", "gaussians", "psnr", "Novel views", GAUSSIANS, "PSNR, dB"),
    Panel("novel_views", "seconds", "lpips", "Novel views", SECONDS, "LPIPS, less is better", more_is_better=False),
    Panel("novel_views", "cpu_seconds", "psnr", "Novel views", CPU_SECONDS, "PSNR, dB"),
    Panel("novel_views", "bytes", "psnr", "Novel views", MEGABYTES, "PSNR, dB"),
    Panel("novel_views", "cpu_seconds", "psnr_disoccluded", "Novel views", CPU_SECONDS, "PSNR of what was hidden, dB"),
    Panel("novel_views", "bytes", "psnr_disoccluded", "Novel views", MEGABYTES, "PSNR of what was hidden, dB"),
    Panel("novel_views", "cpu_seconds", "lpips", "Novel views", CPU_SECONDS, "LPIPS, less is better", False),
    Panel("novel_views", "bytes", "lpips", "Novel views", MEGABYTES, "LPIPS, less is better", False),
    Panel("restoration", "seconds", "psnr_hole", "Restored clips", SECONDS, "PSNR within holes, dB"),
)


@dataclass(frozen=True)
class Point:
    """A method under a recipe: means over rooms, and their standard errors (0 where there is only one room)."""

    label: str
    cost: float
    cost_sem: float
    merit: float
    merit_sem: float
    rooms: int
    on_front: bool = False


def check_charts() -> None:
    """Raises InputError without matplotlib: to be asked before the long part."""
    if importlib.util.find_spec("matplotlib") is None:
        raise InputError('--chart draws with matplotlib: pip install "rein3d-jax[bench]"')


def chart(files: list[Path], picture: Path, points: Path | None = None) -> None:
    """Draws the result files into `picture`, PNG, and writes what it shows into `points`, JSON. Raises InputError
    as check_charts and chart_points do."""
    rooms, panels = chart_points(files)
    check_charts()
    write_bytes(picture, _png(panels, len(rooms)))
    if points is not None:
        table = [{**asdict(panel), "points": [asdict(point) for point in shown]} for panel, shown in panels]
        write_text(points, json.dumps({"rooms": rooms, "panels": table}, indent=1) + "\n")


def chart_points(files: list[Path]) -> tuple[list[str], list[tuple[Panel, list[Point]]]]:
    """The rooms of the result files, and the panels that they have figures for. Raises InputError for files of
    different rooms, for one that is no result of evaluate, and where there is nothing to draw."""
    results = [_result(path) for path in files]
    if any(result["rooms"] != results[0]["rooms"] for result in results):
        raise InputError(f"--chart: {', '.join(map(str, files))} are of different rooms: evaluate all on the same")
    panels = [(panel, shown) for panel in PANELS if (shown := _points(panel, results))]
    if not panels:
        raise InputError(f"--chart: {', '.join(map(str, files))} hold no figures to draw: evaluate novel-views first")
    return results[0]["rooms"], panels


def _result(path: Path) -> dict:
    result = read_json(path)
    if not isinstance(result, dict) or not {"recipe", "rooms"} <= result.keys():
        raise InputError(f"--chart: {path} is no result of evaluate: give files written by its --json")
    return result


def _points(panel: Panel, results: list[dict]) -> list[Point]:
    several = len({result["recipe"] for result in results}) > 1
    points = {}
    for result in results:
        for method, metrics in result.get(panel.protocol, {}).items():
            cost, merit = metrics.get(panel.cost), metrics.get(panel.merit)
            if cost and merit and cost["mean"] is not None and merit["mean"] is not None:
                label = f"{method} ({result['recipe']})" if several else method
                numbers = (cost["mean"], cost["sem"] or 0.0, merit["mean"], merit["sem"] or 0.0)
                points[label] = Point(label, *numbers, len(merit["rooms"]))
    sign = 1 if panel.more_is_better else -1
    listed = list(points.values())
    front = pareto_front([(point.cost, sign * point.merit) for point in listed])
    return [Point(**asdict(point) | {"on_front": i in front}) for i, point in enumerate(listed)]


def _png(panels: list[tuple[Panel, list[Point]]], rooms: int) -> bytes:
    from matplotlib.figure import Figure

    rows = -(-len(panels) // 2)
    figure = Figure(figsize=(15, 4.6 * rows), layout="constrained")
    labels = {point.label: None for _, points in panels for point in points}
    colours = {label: _COLOURS[i % len(_COLOURS)] for i, label in enumerate(labels)}
    axes = figure.subplots(rows, 2, squeeze=False).ravel()
    for axis, (panel, points) in zip(axes, panels, strict=False):
        _draw(axis, panel, points, colours)
    for axis in axes[len(panels) :]:
        axis.set_axis_off()
    note = f"Rooms: {rooms}. Points are means over rooms, bars their standard errors. Line and rings: Pareto front."
    figure.suptitle(note, fontsize=11)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110, metadata={"Software": None})
    return buffer.getvalue()


def _draw(axis, panel: Panel, points: list[Point], colours: dict[str, str]) -> None:
    unit = _UNITS.get(panel.cost, 1.0)
    front = sorted((p for p in points if p.on_front), key=lambda p: p.cost)
    axis.plot([unit * p.cost for p in front], [p.merit for p in front], color="0.6", lw=1.2, zorder=1)
    for point in points:
        place, colour = (unit * point.cost, point.merit), colours[point.label]
        errors = {"xerr": unit * point.cost_sem, "yerr": point.merit_sem}
        axis.errorbar(*place, **errors, color=colour, capsize=3, lw=1, zorder=2)
        edge = {"edgecolor": "black", "linewidth": 1.6} if point.on_front else {"edgecolor": colour}
        axis.scatter(*place, color=colour, s=60, zorder=3, **edge)
    axis.set(title=f"{panel.title}: {panel.merit_label}", xlabel=panel.cost_label, ylabel=panel.merit_label)
    if panel.cost != "gaussians":
        axis.set_xscale("log")
        for which in (axis.xaxis.set_major_formatter, axis.xaxis.set_minor_formatter):
            which("{x:g}")
    axis.margins(x=0.08, y=0.08)
    axis.tick_params(labelsize=8)
    axis.grid(alpha=0.25)
    _label(axis, points, unit, colours)


def _label(axis, points: list[Point], unit: float, colours: dict[str, str]) -> None:
    """Names in a column on the right, in the order of merit, each with a line to its point: none covers another."""
    low, high = axis.get_ylim()
    ranked = sorted(points, key=lambda p: p.merit)
    heights = spread_labels([(p.merit - low) / (high - low) for p in ranked], apart=0.065)
    for point, height in zip(ranked, heights, strict=True):
        axis.annotate(
            f"{point.label}  {point.merit:.3g}",
            (unit * point.cost, point.merit),
            xytext=(1.03, height),
            textcoords="axes fraction",
            va="center",
            fontsize=9,
            color=colours[point.label],
            arrowprops={"arrowstyle": "-", "color": colours[point.label], "lw": 0.6, "alpha": 0.5},
        )


def spread_labels(heights: list[float], apart: float) -> list[float]:
    """Ascending heights moved so that neighbours are `apart`, and as a whole no higher than the axes, 1."""
    placed = []
    for height in heights:
        placed.append(max(height, placed[-1] + apart) if placed else height)
    return [height - max(placed[-1] - 1, 0.0) for height in placed]
