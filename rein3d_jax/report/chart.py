"""Curves as inline SVG, with ticks and axis labels, for a page that loads nothing from elsewhere."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from html import escape

import numpy as np

CURVE_COLOURS = ("#1f7a8c", "#c8553d", "#6a5acd", "#8a7a2a")
MAX_POINTS = 400  # more are finer than a screen's pixels
WIDTH, HEIGHT = 480, 290
LEFT, RIGHT, TOP, BOTTOM = 62, 455, 12, 240  # the frame of the axes


@dataclass(frozen=True)
class Series:
    """One curve: x and y (n,); points that are not finite are left out."""

    label: str
    x: np.ndarray
    y: np.ndarray


@dataclass(frozen=True)
class Chart:
    """Curves that share their axes."""

    title: str
    x_label: str
    y_label: str
    series: tuple[Series, ...]


def line_chart(chart: Chart) -> str:
    """SVG of the chart and a legend, or a sentence where there is nothing to draw."""
    curves = [_thinned(series) for series in chart.series]
    if not sum(len(points) for points in curves):
        return "<p>Nothing was measured.</p>"
    x_ticks, y_ticks = (nice_ticks(*_extent(np.concatenate(curves)[:, axis])) for axis in (0, 1))
    label = escape(f"{chart.title}: {chart.y_label} by {chart.x_label}")
    return (
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{label}">{_axes(chart, x_ticks, y_ticks)}'
        + "".join(_curve(points, x_ticks, y_ticks, i) for i, points in enumerate(curves))
        + f"</svg>{legend([(series.label, _colour(i)) for i, series in enumerate(chart.series)])}"
    )


def legend(entries: list[tuple[str, str]]) -> str:
    """HTML list of names, each with a swatch of its colour."""
    items = (f'<li><i style="background:{colour}"></i>{escape(label)}</li>' for label, colour in entries)
    return f'<ul class="legend">{"".join(items)}</ul>'


_Ticks = Iterable[tuple[float, float]]  # (where it stands on the page, its number)


def axes(across: _Ticks, up: _Ticks, labels: tuple[str, str], *, grid: bool = False) -> str:
    """SVG of both axes with their labels (x, y) and horizontal lines; with `grid` vertical ones as well."""
    x_label, y_label = map(escape, labels)
    middle_x, middle_y = (LEFT + RIGHT) / 2, (TOP + BOTTOM) / 2
    parts = [
        f'<path class="grid" d="M{x:.1f} {TOP}V{BOTTOM}"/>' * grid
        + f'<text x="{x:.1f}" y="{BOTTOM + 18}" text-anchor="middle">{tick:.6g}</text>'
        for x, tick in across
    ]
    parts += [
        f'<path class="grid" d="M{LEFT} {y:.1f}H{RIGHT}"/>'
        f'<text x="{LEFT - 7}" y="{y + 4:.1f}" text-anchor="end">{tick:.6g}</text>'
        for y, tick in up
    ]
    parts += [
        f'<path class="axis" d="M{LEFT} {TOP}V{BOTTOM}H{RIGHT}"/>',
        f'<text x="{middle_x}" y="{HEIGHT - 10}" text-anchor="middle">{x_label}</text>',
        f'<text transform="translate(14 {middle_y}) rotate(-90)" text-anchor="middle">{y_label}</text>',
    ]
    return "".join(parts)


def nice_ticks(low: float, high: float) -> np.ndarray:
    """Multiples of 1, 2 or 5 times a power of ten, three to eight of them, that hold low < high between them."""
    raw = (high - low) / 5
    power = 10.0 ** math.floor(math.log10(raw))
    step = power * next(factor for factor in (1, 2, 5, 10) if factor * power >= raw)
    return np.arange(math.floor(low / step), math.ceil(high / step) + 1) * step


def _extent(values: np.ndarray) -> tuple[float, float]:
    """Least and largest, held apart where they are equal."""
    low, high = float(values.min()), float(values.max())
    apart = max(high - low, 1e-6 * max(abs(low), abs(high)), 1e-9)
    return (low, high) if high - low == apart else (low - apart / 2, high + apart / 2)


def _thinned(series: Series) -> np.ndarray:
    """(m, 2) finite points, at most MAX_POINTS: neighbours are averaged."""
    points = np.stack([np.asarray(series.x, float), np.asarray(series.y, float)], axis=1)
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) <= MAX_POINTS:
        return points
    return np.stack([part.mean(axis=0) for part in np.array_split(points, MAX_POINTS)])


def _place(values: np.ndarray, ticks: np.ndarray, start: float, end: float) -> np.ndarray:
    return start + (values - ticks[0]) / (ticks[-1] - ticks[0]) * (end - start)


def _axes(chart: Chart, x_ticks: np.ndarray, y_ticks: np.ndarray) -> str:
    across = zip(_place(x_ticks, x_ticks, LEFT, RIGHT), x_ticks, strict=True)
    up = zip(_place(y_ticks, y_ticks, BOTTOM, TOP), y_ticks, strict=True)
    return axes(across, up, (chart.x_label, chart.y_label))


def _curve(points: np.ndarray, x_ticks: np.ndarray, y_ticks: np.ndarray, index: int) -> str:
    xs, ys = _place(points[:, 0], x_ticks, LEFT, RIGHT), _place(points[:, 1], y_ticks, BOTTOM, TOP)
    dots = [f"{x:.1f},{y:.1f}" for x, y in zip(xs, ys, strict=True)]
    if len(dots) == 1:  # a line needs two
        return f'<circle cx="{xs[0]:.1f}" cy="{ys[0]:.1f}" r="4" fill="{_colour(index)}"/>'
    return f'<polyline points="{" ".join(dots)}" fill="none" stroke="{_colour(index)}" stroke-width="2"/>'


def _colour(index: int) -> str:
    return CURVE_COLOURS[index % len(CURVE_COLOURS)]
