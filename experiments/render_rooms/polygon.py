"""Plane geometry of floors. A polygon is (n, 2) metres, counter-clockwise, simple; edge i begins at corner i."""

import numpy as np


def polygon_area(corners: np.ndarray) -> float:
    """Square metres, positive when `corners` (n, 2) run counter-clockwise."""
    x, y = corners.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def edge_frame(corners: np.ndarray, edge: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Start, unit direction, unit inward normal, length of one edge."""
    start, end = corners[edge], corners[(edge + 1) % len(corners)]
    length = float(np.linalg.norm(end - start))
    direction = (end - start) / length
    return start, direction, np.array([-direction[1], direction[0]]), length


def inside(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(m,) bool: which `points` (m, 2) lie in the polygon (even-odd rule)."""
    x, y = points[:, 0, None], points[:, 1, None]
    x0, y0 = corners.T
    x1, y1 = np.roll(corners, -1, axis=0).T
    crosses = (y0 > y) != (y1 > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = x0 + (y - y0) * (x1 - x0) / (y1 - y0)
    return np.sum(crosses & (x < at), axis=1) % 2 == 1


def wall_clearance(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(m,) metres from each of `points` (m, 2) to the nearest edge."""
    start = corners[None]
    along = np.roll(corners, -1, axis=0)[None] - start
    offset = points[:, None] - start
    t = np.clip(np.sum(offset * along, -1) / np.sum(along * along, -1), 0, 1)
    return np.min(np.linalg.norm(offset - t[..., None] * along, axis=-1), axis=1)


def is_simple(corners: np.ndarray) -> bool:
    """Whether no two edges cross or touch away from shared corners."""
    n = len(corners)
    return not any(
        _cross(corners[i], corners[(i + 1) % n], corners[j], corners[(j + 1) % n])
        for i in range(n)
        for j in range(i + 2, n)
        if (j + 1) % n != i
    )


def _cross(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> bool:
    def side(p: np.ndarray, q: np.ndarray, r: np.ndarray) -> float:
        return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])

    return side(a, b, c) * side(a, b, d) <= 0 and side(c, d, a) * side(c, d, b) <= 0


def rectangle(centre: np.ndarray, size: tuple[float, float], yaw: float) -> np.ndarray:
    """(4, 2) corners, counter-clockwise, of a rectangle of `size` (along its x, its y) turned by `yaw` radians."""
    c, s = np.cos(yaw), np.sin(yaw)
    half = 0.5 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * np.asarray(size)
    return np.asarray(centre) + half @ np.array([[c, s], [-s, c]])


def overlap(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether two convex polygons share more than a border (separating axes)."""
    for corners in (a, b):
        for edge in range(len(corners)):
            _, _, normal, _ = edge_frame(corners, edge)
            if np.max(a @ normal) <= np.min(b @ normal) + 1e-9 or np.max(b @ normal) <= np.min(a @ normal) + 1e-9:
                return False
    return True


def fits_inside(corners: np.ndarray, convex: np.ndarray) -> bool:
    """Whether a convex polygon lies in `corners`, touching the walls at most."""
    shrunk = convex + (np.mean(convex, axis=0) - convex) * 1e-4
    rim = np.concatenate([shrunk + t * (np.roll(shrunk, -1, axis=0) - shrunk) for t in np.linspace(0, 0.95, 20)])
    return bool(np.all(inside(corners, rim))) and not np.any(inside(shrunk, corners))
