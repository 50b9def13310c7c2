"""Walls, ceiling, windows and doors of a room, by chance. Metres; the floor is z = 0; polygons as in `polygon`."""

from dataclasses import dataclass, replace

import numpy as np

from experiments.render_rooms.polygon import edge_frame, inside, is_simple, overlap, polygon_area, wall_clearance

_SHAPES = ("box", "corner_cut", "alcove", "partition", "breast", "chamfer", "corner_cut+partition", "alcove+breast")
_SHAPE_ODDS = (0.34, 0.18, 0.11, 0.11, 0.08, 0.06, 0.06, 0.06)


@dataclass(frozen=True)
class Opening:
    """A rectangle cut out of one wall."""

    edge: int
    start: float  # metres from the edge's first corner
    width: float
    bottom: float
    top: float
    kind: str  # "window", "door" (closed), "ajar" (an open leaf), "passage" (no leaf), "hole" (a neighbour's door)
    depth: float  # thickness of the wall
    swing: float = 0.0  # radians by which the leaf stands open


@dataclass(frozen=True)
class Floorplan:
    """A room's shell. The ceiling is the lowest of its planes z = a x + b y + c."""

    corners: np.ndarray  # (n, 2)
    ceiling: np.ndarray  # (k, 3) rows a, b, c
    openings: tuple[Opening, ...] = ()
    annexes: tuple["Floorplan", ...] = ()  # rooms beyond open doors

    def ceiling_at(self, points: np.ndarray) -> np.ndarray:
        """(m,) ceiling heights over `points` (m, 2)."""
        return np.min(points @ self.ceiling[:, :2].T + self.ceiling[:, 2], axis=-1)


def draw_floorplan(rng: np.random.Generator, size: tuple[float, float], daylight: bool) -> Floorplan:
    """A room of about `size` metres: doors, windows where it has `daylight`, rooms beyond its open doors."""
    corners = _draw_corners(rng, size)
    plan = Floorplan(corners, _draw_ceiling(rng, corners))
    plan = _add_doors(rng, plan)
    return _add_windows(rng, plan, 0.85) if daylight else plan


def _draw_corners(rng: np.random.Generator, size: tuple[float, float]) -> np.ndarray:
    box = np.array([[0, 0], [size[0], 0], size, [0, size[1]]], float)
    for _ in range(30):
        corners = box
        for shape in str(rng.choice(_SHAPES, p=_SHAPE_ODDS)).split("+"):
            corners = _reshape(rng, corners, shape)
        if is_simple(corners) and polygon_area(corners) > 0.55 * size[0] * size[1]:
            return corners - corners.mean(0)
    return box - box.mean(0)


def _reshape(rng: np.random.Generator, corners: np.ndarray, shape: str) -> np.ndarray:
    edge = int(rng.integers(len(corners)))
    length = edge_frame(corners, edge)[3]
    if shape == "corner_cut":
        return _cut_corner(corners, edge, rng.uniform(0.2, 0.55, 2), False)
    if shape == "chamfer":
        return _cut_corner(corners, edge, rng.uniform(0.12, 0.35, 2), True)
    if shape == "alcove":
        width = rng.uniform(0.3, 0.6) * length
        return _bump(corners, edge, rng.uniform(0.3, length - width - 0.3), width, -rng.uniform(0.4, 1.8))
    if shape == "partition":
        return _bump(
            corners, edge, rng.uniform(0.3, 0.7) * length, rng.uniform(0.1, 0.2), rng.uniform(0.25, 0.5) * length
        )
    if shape == "breast":
        width = min(rng.uniform(0.3, 1.6), 0.5 * length)
        return _bump(corners, edge, rng.uniform(0.1, 0.9) * (length - width), width, rng.uniform(0.15, 0.6))
    return corners


def _cut_corner(corners: np.ndarray, corner: int, shares: np.ndarray, straight: bool) -> np.ndarray:
    """Take away a corner's rectangle (two more corners) or, `straight`, its triangle."""
    here = corners[corner]
    to_next = shares[0] * (corners[(corner + 1) % len(corners)] - here)
    to_last = shares[1] * (corners[corner - 1] - here)
    middle = [] if straight else [here + to_last + to_next]
    return np.concatenate([corners[:corner], [here + to_last, *middle, here + to_next], corners[corner + 1 :]])


def _bump(corners: np.ndarray, edge: int, start: float, width: float, depth: float) -> np.ndarray:
    """Push a part of an edge inwards (depth > 0) or outwards."""
    origin, along, inward, _ = edge_frame(corners, edge)
    a, b = origin + start * along, origin + (start + width) * along
    new = [a, a + depth * inward, b + depth * inward, b]
    return np.concatenate([corners[: edge + 1], new, corners[edge + 1 :]])


def _draw_ceiling(rng: np.random.Generator, corners: np.ndarray) -> np.ndarray:
    area = polygon_area(corners)
    height = float(np.clip(rng.normal(2.6 + 0.006 * area, 0.2), 2.25, 3.8))
    flat = np.array([[0, 0, height]])
    if rng.random() > 0.14:
        return flat
    angle = rng.choice([0, 0.5, 1, 1.5]) * np.pi + (rng.normal(0, 0.3) if rng.random() < 0.2 else 0)
    side = np.array([np.cos(angle), np.sin(angle)])
    reach = corners @ side
    knee = rng.uniform(1.3, 2.1)
    steep = min(np.tan(np.radians(rng.uniform(20, 45))), (3.9 - knee) / np.ptp(reach))
    slope = np.array([[-steep * side[0], -steep * side[1], knee + steep * reach.max()]])
    if rng.random() < 0.35:
        return slope
    if len(corners) == 4 and rng.random() < 0.4:  # a gable
        other = np.array([[steep * side[0], steep * side[1], knee - steep * reach.min()]])
        return np.concatenate([slope, other])
    return np.concatenate([flat, slope])


def _add_doors(rng: np.random.Generator, plan: Floorplan) -> Floorplan:
    doors = 1 + int(rng.random() < 0.5) + int(polygon_area(plan.corners) > 25)
    for _ in range(doors):
        kind = str(rng.choice(["door", "ajar", "passage"], p=[0.4, 0.3, 0.3]))
        wide = rng.uniform(0.8, 0.95) if kind != "passage" else rng.uniform(0.8, 2.2)
        opening = Opening(-1, 0, float(wide), 0, float(rng.uniform(1.98, 2.15)), kind, float(rng.uniform(0.1, 0.3)))
        opening = replace(opening, swing=float(rng.uniform(0.6, 1.7)))
        placed = place_opening(rng, plan, opening)
        if placed is None:
            continue
        if kind == "door":
            plan = replace(plan, openings=(*plan.openings, placed))
            continue
        annex = _draw_annex(rng, plan, placed)
        if annex is not None:
            plan = replace(plan, openings=(*plan.openings, placed), annexes=(*plan.annexes, annex))
    return plan


def place_opening(rng: np.random.Generator, plan: Floorplan, opening: Opening) -> Opening | None:
    """`opening` on a wall by chance where it is clear of corners, ceiling, other openings and other rooms, or None."""
    for _ in range(12):
        edge = int(rng.integers(len(plan.corners)))
        start, along, inward, length = edge_frame(plan.corners, edge)
        room = length - opening.width - 0.3
        if room < 0:
            continue
        placed = replace(opening, edge=edge, start=float(rng.uniform(0.15, 0.15 + room)))
        ends = start + np.outer([placed.start, placed.start + placed.width], along)
        if np.min(plan.ceiling_at(ends)) < placed.top + 0.1 or _meets_another(plan, placed):
            continue
        beyond = ends.mean(0) - np.outer(np.linspace(opening.depth + 0.05, 2.5, 12), inward)
        rooms = [plan.corners, *(annex.corners for annex in plan.annexes)]
        if not any(np.any(inside(corners, beyond)) for corners in rooms):
            return placed
    return None


def _meets_another(plan: Floorplan, new: Opening) -> bool:
    return any(
        old.edge == new.edge and new.start < old.start + old.width + 0.2 and old.start < new.start + new.width + 0.2
        for old in plan.openings
    )


def _draw_annex(rng: np.random.Generator, plan: Floorplan, door: Opening) -> Floorplan | None:
    """A box beyond `door`; its edge 0 is the shared wall."""
    start, along, inward, _ = edge_frame(plan.corners, door.edge)
    for _ in range(8):
        left = door.start - rng.uniform(0.1, 2.0)
        right = door.start + door.width + rng.uniform(0.1, 2.0)
        near, far = door.depth, door.depth + rng.uniform(1.2, 5.0)
        sides = [(right, near), (left, near), (left, far), (right, far)]
        corners = np.array([start + a * along - out * inward for a, out in sides])
        if _free_of_rooms(plan, corners):
            height = max(float(rng.uniform(2.3, 2.9)), door.top + 0.1)
            hole = replace(door, edge=0, start=right - door.start - door.width, kind="hole")
            annex = Floorplan(corners, np.array([[0, 0, height]]), (hole,))
            return _add_windows(rng, annex, 0.5) if rng.random() < 0.6 else annex
    return None


def _free_of_rooms(plan: Floorplan, corners: np.ndarray) -> bool:
    steps = np.linspace(0, 1, 15)
    u, v = np.meshgrid(steps, steps)
    grid = corners[0] + u.reshape(-1, 1) * (corners[1] - corners[0]) + v.reshape(-1, 1) * (corners[3] - corners[0])
    if np.any(inside(plan.corners, grid)) or np.any(inside(corners, plan.corners)):
        return False
    if np.min(wall_clearance(corners, plan.corners)) < 1e-6:
        return False
    return not any(overlap(corners, annex.corners) for annex in plan.annexes)


def _add_windows(rng: np.random.Generator, plan: Floorplan, odds: float) -> Floorplan:
    tall = rng.random() < 0.25  # French windows
    for _ in range(1 + int(polygon_area(plan.corners) / 9)):
        if rng.random() > odds:
            continue
        bottom = float(rng.uniform(0.0, 0.12) if tall else rng.uniform(0.55, 1.15))
        top = float(min(rng.uniform(1.95, 2.35), np.max(plan.ceiling[:, 2]) - 0.15))
        window = Opening(-1, 0, float(rng.uniform(0.6, 2.8)), bottom, top, "window", float(rng.uniform(0.12, 0.35)))
        placed = place_opening(rng, plan, window)
        plan = plan if placed is None else replace(plan, openings=(*plan.openings, placed))
    return plan
