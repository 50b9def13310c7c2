"""The scale of a distance map that has none, by the height of the camera above the floor that the map shows.

A floor is a horizontal surface with nothing below it. Straight down along a column, the drop z of the points seen stays
the same on any horizontal surface, and on a wall grows as the tangent of the angle below the horizon: which tells them
apart whatever the map's unit. Of the drops at which much is horizontal, the floor's is the greatest: beds, tables and a
tripod over the nadir are nearer.
"""

import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.geometry.sphere import latitudes
from rein3d_jax.scene import Panorama

_BELOW = 15.0  # degrees below the horizon from which a floor is looked for: nearer to it, an error of 1 is 7 % of z
_LEVEL = 0.25  # of a wall's growth of log z, below which a surface counts as horizontal
_BIN, _BLUR = 0.005, 0.015  # log z: of the histogram, and the deviation of a floor that an estimator has waved
_PEAK = 0.3  # of the strongest horizontal surface that a floor has, seen between furniture
_WITHIN = 0.05  # log z around the peak that still is the floor
_LEAST = 0.03  # share of what lies below the horizon that a floor must have: a corridor's has 0.1


def height_above_floor(panorama: Panorama) -> float:
    """The height of the camera above the floor, in the distance's own unit, of a level panorama (h, 2 h); furniture, a
    tripod's disc and unknown pixels may hide most of it. Raises InputError where no floor is seen."""
    drops, weights, seen = _horizontal(panorama)
    found = _floor(np.log(drops), weights) if weights.any() else None
    if found is None or found[1] < _LEAST * seen:
        raise InputError("the map shows no floor to take its scale from: give a distance in metres, or a level picture")
    return float(np.exp(found[0]))


def _horizontal(panorama: Panorama) -> tuple[np.ndarray, np.ndarray, float]:
    """Drops (n,) of the points on horizontal surfaces below the camera, their solid angles (n,), and the solid angle of
    all that is known there."""
    down = -np.asarray(latitudes(len(panorama.distance)), np.float64)
    below = down > np.radians(_BELOW)
    down = down[below][:, None]
    valid = np.asarray(panorama.valid)[below]
    drops = np.where(valid, np.asarray(panorama.distance, np.float64)[below], 1) * np.sin(down)
    step = max(len(panorama.distance) // 32, 1)  # rows: 6 degrees, so that noise is less than a wall's growth
    growth = np.log(drops[step:] / drops[:-step]) / np.log(np.tan(down[step:]) / np.tan(down[:-step]))
    level = valid[step:] & valid[:-step] & (np.abs(growth) < _LEVEL)
    weights = np.broadcast_to(np.cos(down), valid.shape)
    return drops[:-step][level], weights[:-step][level], float(np.sum(weights * valid))


def _floor(logs: np.ndarray, weights: np.ndarray) -> tuple[float, float]:
    """The floor's log z and its solid angle: the lowest of the strong peaks of the histogram."""
    edges = np.arange(logs.min() - 5 * _BLUR, logs.max() + 5 * _BLUR + _BIN, _BIN)
    taps = np.exp(-0.5 * (np.arange(-4 * _BLUR, 4 * _BLUR + _BIN, _BIN) / _BLUR) ** 2)
    density = np.convolve(np.histogram(logs, edges, weights=weights)[0], taps, "same")
    peak = np.flatnonzero(density >= _PEAK * density.max())[-1]
    while density[peak - 1] > density[peak]:
        peak -= 1
    near = np.abs(logs - (edges[peak] + edges[peak + 1]) / 2) < _WITHIN
    order = np.argsort(logs[near])
    reached = np.cumsum(weights[near][order])
    return float(logs[near][order][np.searchsorted(reached, reached[-1] / 2)]), float(reached[-1])
