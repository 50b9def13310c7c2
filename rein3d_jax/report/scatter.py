"""Methods as marks on accuracy against cost, the cost on a log scale, as inline SVG."""

import math
from dataclasses import dataclass
from html import escape

import numpy as np

from rein3d_jax.report.chart import BOTTOM, CURVE_COLOURS, HEIGHT, LEFT, RIGHT, TOP, WIDTH, axes, legend, nice_ticks

_OWN = "#23303a"


@dataclass(frozen=True)
class Mark:
    """One method; `merit` None draws its cost as a line from bottom to top."""

    label: str
    cost: float  # above 0
    merit: float | None
    own: bool = False  # drawn larger, in a colour of its own


@dataclass(frozen=True)
class Scatter:
    """Marks that share their axes."""

    title: str
    caption: str
    cost_label: str
    merit_label: str
    marks: tuple[Mark, ...]


def scatter_chart(scatter: Scatter) -> str:
    """SVG of the chart and a legend, or a sentence where there is nothing to draw."""
    marks = [mark for mark in scatter.marks if _drawable(mark)]
    merits = [mark.merit for mark in marks if mark.merit is not None]
    if not merits:
        return "<p>Nothing was measured.</p>"
    across = cost_ticks([mark.cost for mark in marks])
    up = nice_ticks(min(merits) - 0.5, max(merits) + 0.5)
    colours = [_OWN if mark.own else CURVE_COLOURS[i % len(CURVE_COLOURS)] for i, mark in enumerate(marks)]
    places = [(_x(tick, across), tick) for tick in across], [(_y(tick, up), tick) for tick in up]
    frame = axes(*places, (scatter.cost_label, scatter.merit_label), grid=True)
    drawn = "".join(_mark(mark, colour, across, up) for mark, colour in zip(marks, colours, strict=True))
    label = escape(f"{scatter.title}: {scatter.merit_label} by {scatter.cost_label}")
    return f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{label}">{frame}{drawn}</svg>' + legend(
        [(_legend_text(mark), colour) for mark, colour in zip(marks, colours, strict=True)]
    )


def cost_ticks(costs: list[float]) -> np.ndarray:
    """Multiples 1, 2 and 5 of powers of ten that hold all `costs` between them; every one, or powers alone where those
    are many."""
    # A logarithm may round to a whole number, on either side of it.
    low, high = math.floor(math.log10(min(costs)) - 1e-9), math.ceil(math.log10(max(costs)) + 1e-9)
    factors = (1, 2, 5) if high - low <= 2 else (1,)
    ticks = np.array([factor * 10.0**power for power in range(low, high + 1) for factor in factors])
    first, last = np.flatnonzero(ticks <= min(costs))[-1], np.flatnonzero(ticks >= max(costs))[0]
    return ticks[first : max(last, first + 1) + 1]


def _drawable(mark: Mark) -> bool:
    return math.isfinite(mark.cost) and mark.cost > 0 and (mark.merit is None or math.isfinite(mark.merit))


def _legend_text(mark: Mark) -> str:
    merit = "" if mark.merit is None else f", {mark.merit:.2f}"
    return f"{mark.label}: {mark.cost:.3g}{merit}"


def _x(cost: float, ticks: np.ndarray) -> float:
    return LEFT + math.log(cost / ticks[0]) / math.log(ticks[-1] / ticks[0]) * (RIGHT - LEFT)


def _y(merit: float, ticks: np.ndarray) -> float:
    return BOTTOM + (merit - ticks[0]) / (ticks[-1] - ticks[0]) * (TOP - BOTTOM)


def _mark(mark: Mark, colour: str, across: np.ndarray, up: np.ndarray) -> str:
    x = _x(mark.cost, across)
    if mark.merit is None:
        return f'<path d="M{x:.1f} {TOP}V{BOTTOM}" stroke="{colour}" stroke-width="2.5" stroke-dasharray="6 4"/>'
    radius = 8 if mark.own else 5
    return f'<circle cx="{x:.1f}" cy="{_y(mark.merit, up):.1f}" r="{radius}" fill="{colour}"/>'
