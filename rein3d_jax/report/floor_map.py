"""The room from above as inline SVG: what was found around the panorama, where cameras may go, and where they went."""

from dataclasses import dataclass

import numpy as np

from rein3d_jax.geometry.sphere import azimuths, horizontal_direction
from rein3d_jax.report.chart import legend

_SIZE = 480  # SVG units of the longer side
_MARGIN = 0.4  # metres round what is drawn
_WALLS, _SAFE, _PATH, _VIEW, _ORIGIN = "#5b6670", "#bfe3d0", "#1f7a8c", "#c8553d", "#23303a"


@dataclass(frozen=True)
class FloorMap:
    """The map's lines and points: world positions on the floor plane, (x, y) metres."""

    walls: np.ndarray  # (m, 2) outline of the nearest surfaces at eye height
    safe: np.ndarray  # (k, 2) outline of where a camera's centre may be
    paths: tuple[np.ndarray, ...]  # (f, 2) each
    views: np.ndarray  # (n, 2) where the scene was compared with ground truth; may be empty


def outline(profile: np.ndarray) -> np.ndarray:
    """(w, 2) metres: the closed outline of a distance for each column (w,), metres, at the horizon."""
    directions = np.asarray(horizontal_direction(azimuths(len(profile))))[:, :2]
    return np.asarray(profile)[:, None] * directions


def render_floor_map(floor_map: FloorMap) -> str:
    """SVG of the map and a legend. The panorama's centre column points up the page; the grid is 1 m."""
    low, high = _bounds(floor_map)
    scale = _SIZE / (high - low).max()
    width, height = (high - low) * scale
    shapes = [
        _line(floor_map.walls, f'fill="#fff" stroke="{_WALLS}" stroke-width="2.5"', low, scale, closed=True),
        _line(floor_map.safe, f'fill="{_SAFE}" stroke="none"', low, scale, closed=True),
        _grid(low, high, scale),
        *(_line(path, f'fill="none" stroke="{_PATH}" stroke-width="2"', low, scale) for path in floor_map.paths),
        *(_dot(path[-1], _PATH, 3, low, scale) for path in floor_map.paths if len(path)),
        *(_dot(view, _VIEW, 6, low, scale) for view in floor_map.views),
        _dot(np.zeros(2), _ORIGIN, 6, low, scale),
    ]
    entries = [("nearest surface", _WALLS), ("safe for a camera", _SAFE), ("camera paths", _PATH)]
    entries += [("ground-truth views", _VIEW)] * bool(len(floor_map.views))
    entries += [("panorama, looking up the page", _ORIGIN)]
    return (
        f'<svg class="plan" viewBox="0 0 {width:.1f} {height:.1f}" role="img" aria-label="The room from above">'
        f"{''.join(shapes)}</svg>{legend(entries)}"
    )


def _page(points: np.ndarray) -> np.ndarray:
    """World (x forward, y left) -> metres on the page (right, down)."""
    return -np.asarray(points, float).reshape(-1, 2)[:, ::-1]


def _bounds(floor_map: FloorMap) -> tuple[np.ndarray, np.ndarray]:
    """Page corners (2,), (2,) in metres. A surface seen far through a door or window may leave the page."""
    walls = _page(floor_map.walls)
    radii = np.linalg.norm(walls, axis=1)
    walls = walls[radii <= 5 * np.median(radii)] if len(walls) else walls
    drawn = np.concatenate([walls, np.zeros((1, 2)), *map(_page, (floor_map.safe, *floor_map.paths, floor_map.views))])
    return drawn.min(axis=0) - _MARGIN, drawn.max(axis=0) + _MARGIN


def _line(points: np.ndarray, style: str, low: np.ndarray, scale: float, *, closed: bool = False) -> str:
    corners = " ".join(f"{x:.1f},{y:.1f}" for x, y in (_page(points) - low) * scale)
    return f'<{"polygon" if closed else "polyline"} points="{corners}" {style}/>'


def _dot(point: np.ndarray, colour: str, radius: float, low: np.ndarray, scale: float) -> str:
    ((x, y),) = (_page(point) - low) * scale
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius}" fill="{colour}" stroke="#fff" stroke-width="1.5"/>'


def _grid(low: np.ndarray, high: np.ndarray, scale: float) -> str:
    metres = [np.arange(np.ceil(a), b) for a, b in zip(low, high, strict=True)]
    across, down = ((m - start) * scale for m, start in zip(metres, low, strict=True))
    width, height = (high - low) * scale
    lines = [f"M{x:.1f} 0V{height:.1f}" for x in across] + [f"M0 {y:.1f}H{width:.1f}" for y in down]
    return f'<path class="grid" d="{"".join(lines)}"/>'
