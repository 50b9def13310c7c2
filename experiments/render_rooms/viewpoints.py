"""Where panoramas are taken: free floor, plausible heights, any direction; and short straight walks."""

import numpy as np

from experiments.render_rooms.arrangement import Arrangement
from experiments.render_rooms.polygon import inside, wall_clearance

_APART = 0.1  # metres between the panoramas of a walk, as in the paper's videos


def draw_viewpoints(a: Arrangement, count: int) -> list[dict]:
    """Up to `count` cameras: place (3,), yaw of the centre column, far from each other and clear of everything."""
    spots = _free_spots(a, 0.3)
    views: list[dict] = []
    for _ in range(count):
        if len(spots) == 0:
            break
        room = wall_clearance(a.plan.corners, spots)
        apart = np.min([np.linalg.norm(spots - v["place"][:2], axis=1) for v in views] or [np.ones(len(spots))], axis=0)
        weight = np.clip(room, 0.1, 1.2) * np.clip(apart, 0.0, 1.5) ** 2 + 1e-9
        spot = spots[a.rng.choice(len(spots), p=weight / weight.sum())]
        height = min(_height(a.rng), float(a.plan.ceiling_at(spot[None])[0]) - 0.25)
        views.append(
            {"place": [float(spot[0]), float(spot[1]), float(height)], "yaw": float(a.rng.uniform(-np.pi, np.pi))}
        )
    return views


def draw_walk(a: Arrangement, view: dict, frames: int) -> list[dict]:
    """A straight walk of at most `frames` panoramas from `view`, one direction of view throughout."""
    start = np.array(view["place"])
    best: list[np.ndarray] = [start]
    for heading in a.rng.uniform(-np.pi, np.pi, 16):
        step = _APART * np.array([np.cos(heading), np.sin(heading), 0])
        path = [start]
        while len(path) < frames and _is_clear(a, path[-1] + step, 0.3):
            path.append(path[-1] + step)
        best = max(best, path, key=len)
    return [{"place": place.tolist(), "yaw": view["yaw"]} for place in best]


def panorama_rays(height: int, yaw: float) -> np.ndarray:
    """(h, 2 h, 3) unit rays in the room's frame of a panorama whose centre column looks along `yaw`."""
    latitude = (0.5 - (np.arange(height) + 0.5) / height)[:, None] * np.pi
    azimuth = ((np.arange(2 * height) + 0.5) / (2 * height) - 0.5)[None] * 2 * np.pi
    heading = yaw - azimuth  # columns turn right
    rays = np.cos(latitude) * np.cos(heading), np.cos(latitude) * np.sin(heading), np.sin(latitude) + 0 * heading
    return np.stack(rays, axis=-1)


def _height(rng: np.random.Generator) -> float:
    """Metres: tripods and eyes mostly, sometimes low or high."""
    if rng.random() < 0.8:
        return float(np.clip(rng.normal(1.53, 0.1), 1.3, 1.75))
    return float(rng.uniform(0.8, 2.2))


def _free_spots(a: Arrangement, margin: float) -> np.ndarray:
    low, high = a.plan.corners.min(0), a.plan.corners.max(0)
    points = a.rng.uniform(low, high, (600, 2))
    points = points[inside(a.plan.corners, points)]
    points = points[wall_clearance(a.plan.corners, points) > margin + 0.1] if len(points) else points
    return np.array([p for p in points if _is_clear(a, np.array([*p, 1.5]), margin)]).reshape(-1, 2)


def _is_clear(a: Arrangement, place: np.ndarray, margin: float) -> bool:
    """Whether the floor below `place` and the air around it are free."""
    point = place[None, :2]
    if not inside(a.plan.corners, point)[0] or wall_clearance(a.plan.corners, point)[0] < margin:
        return False
    if float(a.plan.ceiling_at(point)[0]) < place[2] + 0.2:
        return False
    for piece in a.placed:
        if piece.base > place[2] + 0.3 or piece.size[2] < 0.03:
            continue
        area = piece.footprint
        if inside(area, point)[0] or wall_clearance(area, point)[0] < margin * 0.7:
            return False
    return True
