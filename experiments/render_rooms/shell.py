"""A floorplan as faces: walls with their holes, floor, ceiling, and the analytic distance to them."""

from dataclasses import dataclass, replace

import numpy as np

from experiments.render_rooms.floorplan import Floorplan, Opening
from experiments.render_rooms.polygon import edge_frame, inside


@dataclass(frozen=True)
class Face:
    """A plane polygon of one material; texture coordinates are metres on its plane."""

    material: str
    corners: np.ndarray  # (n, 3), counter-clockwise seen from inside the room
    part: str = "room"  # or what a picture of the emptied room leaves out: "furniture", or "flat" on floor or wall


def as_part(faces: list[Face], part: str) -> list[Face]:
    """The same faces as a `part` of what the room holds."""
    return [replace(face, part=part) for face in faces]


def shell_faces(plan: Floorplan, names: dict[str, str]) -> list[Face]:
    """Floor, ceiling, walls, reveals; `names`: the materials of "floor", "ceiling", "wall", "accent", "frame"."""
    faces = [Face(names["floor"], _lift(plan.corners, np.zeros(len(plan.corners))))]
    faces += [Face(names["ceiling"], corners) for corners in _ceiling_faces(plan)]
    accent = int(np.argmax([edge_frame(plan.corners, edge)[3] for edge in range(len(plan.corners))]))
    for edge in range(len(plan.corners)):
        name = names["accent"] if edge == accent else names["wall"]
        faces += [Face(name, corners) for corners in _wall_faces(plan, edge)]
    for opening in plan.openings:
        if opening.kind != "hole":
            faces += [Face(names["frame"], corners) for corners in _reveal(plan, opening)]
    return faces


def floorplan_distance(plan: Floorplan, origin: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """Metres along unit `rays` (..., 3) from `origin` (3,) inside to walls, floor or ceiling, openings closed."""
    flat = rays.reshape(-1, 3)
    with np.errstate(divide="ignore", invalid="ignore"):
        floor = np.where(flat[:, 2] < 0, -origin[2] / flat[:, 2], np.inf)
        a, b, c = plan.ceiling.T
        rise = flat[:, 2:] - flat[:, :1] * a - flat[:, 1:2] * b
        gap = c + origin[0] * a + origin[1] * b - origin[2]
        above = np.where(rise > 0, gap / rise, np.inf).min(axis=1)
        walls = [_wall_distance(plan.corners, edge, origin, flat) for edge in range(len(plan.corners))]
    return np.minimum.reduce([floor, above, *walls]).reshape(rays.shape[:-1])


def _wall_distance(corners: np.ndarray, edge: int, origin: np.ndarray, rays: np.ndarray) -> np.ndarray:
    start, along, inward, length = edge_frame(corners, edge)
    distance = (start - origin[:2]) @ inward / (rays[:, :2] @ inward)
    at = (origin[:2] + distance[:, None] * rays[:, :2] - start) @ along
    return np.where((distance > 0) & (at >= 0) & (at <= length), distance, np.inf)


def _lift(points: np.ndarray, heights: np.ndarray) -> np.ndarray:
    return np.concatenate([points, np.asarray(heights)[:, None]], axis=1)


def _ceiling_faces(plan: Floorplan) -> list[np.ndarray]:
    """The part of the floor's polygon under each plane, lifted onto it, seen from below."""
    faces = []
    for plane in plan.ceiling:
        part = plan.corners
        for other in plan.ceiling:
            if other is not plane:
                part = _clip(part, other - plane)
        if len(part) > 2:
            faces.append(_lift(part, part @ plane[:2] + plane[2])[::-1])
    return faces


def _clip(corners: np.ndarray, line: np.ndarray) -> np.ndarray:
    """The part of a polygon where a x + b y + c >= 0."""
    kept = []
    value = corners @ line[:2] + line[2]
    for i in range(len(corners)):
        j = (i + 1) % len(corners)
        if value[i] >= 0:
            kept.append(corners[i])
        if value[i] * value[j] < 0:
            kept.append(corners[i] + value[i] / (value[i] - value[j]) * (corners[j] - corners[i]))
    return np.array(kept).reshape(-1, 2)


def _wall_faces(plan: Floorplan, edge: int) -> list[np.ndarray]:
    """Strips between all openings' ends and the ceiling's creases, with the openings left out."""
    start, along, _, length = edge_frame(plan.corners, edge)
    holes = [opening for opening in plan.openings if opening.edge == edge]
    cuts = {0.0, length, *_creases(plan, start, along, length)}
    cuts |= {at for hole in holes for at in (hole.start, hole.start + hole.width)}
    faces = []
    for left, right in zip(sorted(cuts)[:-1], sorted(cuts)[1:], strict=True):
        ends = start + np.outer([left, right], along)
        tops = plan.ceiling_at(ends + 1e-9 * np.outer([1, -1], along))
        hole = next((h for h in holes if h.start - 1e-9 <= left and right <= h.start + h.width + 1e-9), None)
        if hole is None:
            faces.append(_upright(ends, np.zeros(2), tops))
            continue
        faces.append(_upright(ends, np.full(2, hole.top), tops))
        if hole.bottom > 0:
            faces.append(_upright(ends, np.zeros(2), np.full(2, hole.bottom)))
    return faces


def _creases(plan: Floorplan, start: np.ndarray, along: np.ndarray, length: float) -> list[float]:
    """Where along an edge two planes of the ceiling meet."""
    found = []
    for i, one in enumerate(plan.ceiling):
        for other in plan.ceiling[i + 1 :]:
            change = (one - other)[:2] @ along
            if abs(change) > 1e-9:
                at = -((one - other)[:2] @ start + one[2] - other[2]) / change
                found += [float(at)] if 0 < at < length else []
    return found


def _upright(ends: np.ndarray, bottoms: np.ndarray, tops: np.ndarray) -> np.ndarray:
    """A wall's strip seen from inside, whose edge runs to the right as seen from outside."""
    (a, b), (low_a, low_b), (high_a, high_b) = ends, bottoms, tops
    return np.array([[*a, low_a], [*a, high_a], [*b, high_b], [*b, low_b]])[::-1]


def _reveal(plan: Floorplan, opening: Opening) -> list[np.ndarray]:
    """The four inner sides of an opening's thickness."""
    start, along, inward, _ = edge_frame(plan.corners, opening.edge)
    near = start + np.outer([opening.start, opening.start + opening.width], along)
    far = near - opening.depth * inward
    low, high = opening.bottom, opening.top
    loop = [[*near[0], low], [*near[1], low], [*near[1], high], [*near[0], high]]
    back = [[*far[0], low], [*far[1], low], [*far[1], high], [*far[0], high]]
    return [np.array([loop[i], loop[(i + 1) % 4], back[(i + 1) % 4], back[i]]) for i in range(4)]


def is_in_room(plan: Floorplan, point: np.ndarray) -> bool:
    """Whether `point` (3,) lies between floor, walls and ceiling."""
    over = point[None, :2]
    return bool(inside(plan.corners, over)[0]) and 0 < point[2] < float(plan.ceiling_at(over)[0])
