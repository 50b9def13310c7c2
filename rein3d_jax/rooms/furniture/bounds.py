"""Bounds of parts of furniture, linear in a piece's width, depth and height.

A piece stands centred on the origin of its own axes: x along the wall from -W/2 to W/2, y from -D/2 (its front) to D/2
(its back, at the wall), z from 0 to H. Bounds are written with the unit vectors W, D, H and M, one metre:
`(-W / 2 + 0.05 * M, W / 2)`."""

import numpy as np

W, D, H, M = np.eye(4)
O = 0 * M  # the floor, or the middle
Bounds = tuple[np.ndarray, np.ndarray]

ACROSS: Bounds = (-W / 2, W / 2)
DEEP: Bounds = (-D / 2, D / 2)


def around(centre: np.ndarray, half: float | np.ndarray) -> Bounds:
    """Bounds centre - half, centre + half; a number is metres."""
    half = half * M if np.isscalar(half) else half
    return centre - half, centre + half


def inset(bounds: Bounds, by: float) -> Bounds:
    """Bounds drawn in by metres at both ends."""
    return bounds[0] + by * M, bounds[1] - by * M


def intervals(count: int, low: np.ndarray, high: np.ndarray) -> list[Bounds]:
    """Bounds of `count` equal intervals from `low` to `high`."""
    return [(low + (high - low) * (i / count), low + (high - low) * ((i + 1) / count)) for i in range(count)]
