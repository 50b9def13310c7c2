"""Where an upright agent can walk on a collider's floor: the floor less all that stands in the way of its body, grown
by its radius."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.meshes.collider import Collider
from rein3d_jax.meshes.solid import box_solid, closed_solid, manifold_library
from rein3d_jax.settings import Settings, setting

_SEGMENTS = 64  # of a circle
_SLACK = 0.002  # metres farther away than asked, so that corners may be left out
_SOLE = 1e-3  # metres between the floor and what counts as standing on it
_POINT = 1e-4  # metres: the side of what stands for a point


@dataclass(frozen=True)
class AgentConfig(Settings):
    """Who walks: an upright cylinder."""

    radius: float = setting(0.25, "of the agent", within="[0.01, 5]", unit="metres")
    height: float = setting(1.6, "of the agent", within="[0.05, 5]", unit="metres")


@dataclass(frozen=True)
class WalkableFloor:
    """A polygon with holes on the floor, where the agent's middle can be; it hangs together."""

    outline: np.ndarray  # (k, 2) metres in the world, counted to the left
    holes: tuple[np.ndarray, ...]  # (k, 2) each, counted to the right
    faces: np.ndarray  # (f, 3) int into the outline's and the holes' corners, one after another; fronts upwards
    floor: float  # z, metres
    area: float  # square metres
    start: np.ndarray  # (3,) metres: below the world's origin, or the corner nearest to that
    agent: AgentConfig

    @property
    def corners(self) -> np.ndarray:
        """All corners (v, 3), metres in the world."""
        flat = np.concatenate([self.outline, *self.holes])
        return np.concatenate([flat, np.full((len(flat), 1), self.floor)], axis=1)


def walkable_floor(collider: Collider, agent: AgentConfig = AgentConfig()) -> WalkableFloor:
    """The part of the floor where `agent` can walk to from below the world's origin; if it cannot stand there, the
    largest part where it can stand. Every point of it is at least its radius away from what it could run into.
    Raises InputError if it can stand nowhere, or without the extra `export`."""
    room = _standing_room(collider, agent)
    if room.is_empty():
        mend = "give a smaller --radius or --height"
        raise InputError(f"an agent of {agent.radius} x {agent.height} m can stand nowhere on the floor: {mend}")
    library = manifold_library()
    foot = library.CrossSection.square((_POINT, _POINT), True)
    part = max(room.decompose(), key=lambda part: (not (part ^ foot).is_empty(), part.area()))
    rings = part.to_polygons()
    outline = next(i for i, ring in enumerate(rings) if _area(ring) > 0)
    rings = [rings.pop(outline), *rings]
    corners = np.concatenate(rings)
    below = np.zeros(2) if not (part ^ foot).is_empty() else corners[np.linalg.norm(corners, axis=1).argmin()]
    start = np.array([*below, collider.floor])
    faces = np.asarray(library.triangulate(rings), np.int64)
    return WalkableFloor(rings[0], tuple(rings[1:]), faces, collider.floor, part.area(), start, agent)


def _standing_room(collider: Collider, agent: AgentConfig) -> Any:
    """The CrossSection of places where the agent's middle can be."""
    low, high = collider.vertices.min(axis=0), collider.vertices.max(axis=0)
    margin = 2 * agent.radius
    bottom, top = collider.floor + _SOLE, collider.floor + agent.height
    layer = box_solid([*(low[:2] - margin), bottom], [*(high[:2] + margin), top])
    in_the_way = (layer - closed_solid(collider.vertices, collider.faces[:, ::-1])).project()
    library = manifold_library()
    reach = agent.radius / np.cos(np.pi / _SEGMENTS) + _SLACK  # chords are nearer than their circle
    kept_off = in_the_way.offset(reach, library.JoinType.Round, circular_segments=_SEGMENTS)
    floor = library.CrossSection.square(high[:2] - low[:2]).translate(low[:2])
    return (floor - kept_off).simplify(_SLACK)


def _area(ring: np.ndarray) -> float:
    """Square metres, positive where the ring (k, 2) is counted to the left."""
    x, y = ring.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2
