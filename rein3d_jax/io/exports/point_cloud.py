"""Coloured points, from which other tools start: thinned from a scene, and as the PLY that they read."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rein3d_jax.geometry.spherical_harmonics import C0
from rein3d_jax.io.files.atomic import write_bytes
from rein3d_jax.io.pictures.image import to_uint8
from rein3d_jax.scene import Gaussians

_ROW = np.dtype([(axis, "<f4") for axis in "xyz"] + [(name, "u1") for name in ("red", "green", "blue")])


@dataclass(frozen=True)
class Points:
    """n points of the world."""

    places: np.ndarray  # (n, 3) float64 metres
    colours: np.ndarray  # (n, 3) uint8 sRGB


def thinned_points(gaussians: Gaussians, limit: int) -> Points:
    """The centres of the scene's splats that cover more than half of what is behind them, evenly thinned to at most
    `limit`; their colours without what depends on the view."""
    chosen = np.flatnonzero(np.asarray(gaussians.alive) & (np.asarray(gaussians.opacity_logits) > 0))
    chosen = chosen[np.linspace(0, len(chosen) - 1, min(limit, len(chosen))).astype(int)]
    colours = 0.5 + C0 * np.asarray(gaussians.sh)[chosen, 0]
    return Points(np.asarray(gaussians.means, np.float64)[chosen], to_uint8(colours))


def write_points(path: Path, points: Points) -> None:
    """Writes `points` as a binary PLY, atomically. Raises InputError."""
    rows = np.empty(len(points.places), _ROW)
    for column, name in enumerate("xyz"):
        rows[name] = points.places[:, column]
    for column, name in enumerate(("red", "green", "blue")):
        rows[name] = points.colours[:, column]
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(rows)}"]
    lines += [f"property float {axis}" for axis in "xyz"]
    lines += [f"property uchar {name}" for name in ("red", "green", "blue")] + ["end_header", ""]
    write_bytes(path, "\n".join(lines).encode() + rows.tobytes())
