"""What a regime's measurements say: curves over severity, where ours breaks, and where a peer is better."""

import itertools
import math
from collections.abc import Iterator

import numpy as np

from benchmarks.stability.regime import OURS, Figure, Regime

Readings = dict[str, dict[str, np.ndarray]]  # method -> figure -> (severities, seeds)


_TIE = 0.01  # of a figure's tolerance: no peer is better by so little


def readings_of(regime: Regime, *, quick: bool = False) -> Readings:
    """All that is measured; `quick`: one seed, at the mild and the two outermost severities."""
    severities = _few(regime) if quick else regime.severities
    seeds = 1 if quick else regime.seeds
    found = [[regime.measure(severity, seed) for seed in range(seeds)] for severity in severities]
    methods = {name: list(figures) for name, figures in found[0][0].items()}
    return {
        name: {key: np.array([[one[name][key] for one in row] for row in found]) for key in keys}
        for name, keys in methods.items()
    }


def table_of(regime: Regime, readings: Readings, *, quick: bool = False) -> dict:
    """A regime for JSON: its axis, every method's [mean, standard error] by figure and severity, and the verdict."""
    severities = _few(regime) if quick else regime.severities
    curves = {
        name: {key: [_mean_and_error(row) for row in values] for key, values in figures.items()}
        for name, figures in readings.items()
    }
    key, ours = regime.figure.key, readings[OURS]
    peers = {name: figures[key] for name, figures in readings.items() if name != OURS and not is_ours(name)}
    means = np.array([mean for mean, _ in curves[OURS][key]], float)
    return {
        "users_see": regime.users_see, "rows": regime.rows, "axis": regime.axis, "severities": list(severities),
        "mild": regime.mild, "figure": key, "label": regime.figure.label, "better": regime.figure.better,
        "tolerance": regime.figure.tolerance, "seeds": readings[OURS][key].shape[1],
        "breaks_at": breaking_points(severities, regime.mild, means, regime.figure),
        "behind": behind(ours[key], peers, list(severities), regime.figure), "curves": curves,
    }  # fmt: skip


def is_ours(name: str) -> bool:
    """Whether a curve is a variant of ours, and no peer."""
    return name.startswith(OURS)


def breaking_points(severities, mild: float, means: np.ndarray, figure: Figure) -> list[float | None]:
    """The severities below and above `mild` at which the figure first is worse than at `mild` by its tolerance, between
    the points by straight lines; None where it never is, or there is no such side."""
    start = list(severities).index(mild)
    sides = range(start, -1, -1), range(start, len(severities))
    return [_first_crossing([(severities[i], figure.sign * (means[start] - means[i])) for i in side], figure.tolerance)
            for side in sides]  # fmt: skip


def _first_crossing(points: list[tuple[float, float]], limit: float) -> float | None:
    for (a, before), (b, after) in itertools.pairwise(points):
        if after > limit:
            share = (limit - before) / (after - before) if math.isfinite(before) and after > before else 0.0
            return float(f"{a + min(max(share, 0.0), 1.0) * (b - a):.3g}")
    return None


def behind(ours: np.ndarray, peers: dict[str, np.ndarray], severities: list, figure: Figure) -> dict[str, dict]:
    """Peer -> the severities at which it is better than ours (severities, seeds) by more than the standard error of the
    difference seed by seed, and the most it is better by."""
    found = {}
    for name, other in peers.items():
        worse = figure.sign * (other - ours)
        mean, error = (np.array(column, float) for column in zip(*map(_mean_and_error, worse), strict=True))
        where = mean > error + _TIE * figure.tolerance
        if where.any():
            at = [severity for severity, is_worse in zip(severities, where, strict=True) if is_worse]
            found[name] = {"at": at, "most": float(f"{mean[where].max():.4g}")}
    return found


def _mean_and_error(values: np.ndarray) -> list[float | None]:
    """Mean and its standard error over seeds: None without any that has the figure, an error of 0 for a single one."""
    known = values[~np.isnan(values)]
    if not known.size:
        return [None, 0.0]
    error = known.std(ddof=1) / math.sqrt(known.size) if known.size > 1 else 0.0
    return [float(f"{known.mean():.4g}"), float(f"{error:.3g}")]


def _few(regime: Regime) -> tuple[float, ...]:
    return tuple(dict.fromkeys(sorted((regime.severities[0], regime.mild, regime.severities[-1]))))


def lines_of(table: dict[str, dict]) -> Iterator[str]:
    """The rows of the README's table."""
    yield "| regime | axis | figure | mild | at the ends | breaks at | behind a peer |"
    yield "|---|---|---|---|---|---|---|"
    for name, row in table.items():
        curve = row["curves"][OURS][row["figure"]]
        mild = curve[row["severities"].index(row["mild"])][0]
        ends = " / ".join(_said(value[0]) for s, value in zip(row["severities"], curve, strict=True)
                          if s in (row["severities"][0], row["severities"][-1]) and s != row["mild"])  # fmt: skip
        broken = " and ".join(f"{at:g}" for at in row["breaks_at"] if at is not None) or "-"
        lost = "; ".join(_lost(peer, **x) for peer, x in row["behind"].items()) or "-"
        yield f"| {name} | {row['axis']} | {row['label']} | {_said(mild)} | {ends} | {broken} | {lost} |"


def _lost(peer: str, at: list[float], most: float) -> str:
    return f"{peer} by {most:.2g} ({at[0]:g}{f' to {at[-1]:g}' if len(at) > 1 else ''})"


def _said(value: float | None) -> str:
    return "none" if value is None else f"{value:.3g}"
