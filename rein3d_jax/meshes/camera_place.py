"""Where a camera can stand in a mesh scene: eye height over the floor, under the same roof, clear of everything."""

from dataclasses import dataclass

import numpy as np

from rein3d_jax.conventions import EYE_HEIGHT
from rein3d_jax.errors import InputError
from rein3d_jax.meshes.mesh_scene import MeshScene

_LEVELS = (0.4, 1.0)  # metres above the floor at which, besides eye height, clearance is measured
_AZIMUTHS = 48
_GRID_STEP, _GRID_SIZE = 0.1, 64  # metres between places tried at least, and places tried along a side at most
_FLAT = 0.99  # |cosine| of a normal that counts as level
_BIN = 0.02  # metres: a floor's triangles may lie this far apart
_ENCLOSED = 0.75  # the share of rays at eye height that must meet something: doors stand open, outside it is half
_ON_FLOOR = 0.05  # metres
_EQUAL = 1e-3  # metres: less is rounding, which must not decide


@dataclass(frozen=True)
class CameraPlace:
    """A place where a camera can stand."""

    eye: np.ndarray  # (3,) metres, in the scene's world
    clearance: float  # metres, horizontally, to the nearest thing at any of three heights


def floor_height(scene: MeshScene) -> float:
    """Metres to the floor, in the scene's world: the lowest level with at least half as much level area as the largest
    such level in the lower half of the scene. A house of several storeys gives its lowest. Raises InputError."""
    caster = scene.caster
    heights = scene.soup.corners[:, :, 2].mean(axis=1) - scene.origin[2]
    low, high = scene.bounds[:, 2]
    level = (np.abs(caster.normal[:, 2]) > _FLAT) & (heights < (low + high) / 2)
    if not level.any():
        raise InputError(f"{scene.name} has no level surface in its lower half: check which axis is up")
    bins = np.floor((heights[level] - low) / _BIN).astype(int)
    area = np.bincount(bins, caster.area[level])
    floor = np.flatnonzero(area >= area.max() / 2)[0]
    return float(np.average(heights[level][bins == floor], weights=caster.area[level][bins == floor]))


def find_camera_place(scene: MeshScene, *, floor: float | None = None, eye_height: float = EYE_HEIGHT) -> CameraPlace:
    """The place of most clearance on a grid over the scene, `eye_height` above `floor` (found if not given): floor
    straight below, something above, and around it walls. The same scene gives the same place; of equals, the middle.
    Raises InputError if there is no such place."""
    floor = floor_height(scene) if floor is None else floor
    eyes = _grid(scene, floor + eye_height)
    eyes = eyes[_between_floor_and_roof(scene, eyes, eye_height)]
    if len(eyes):
        clearance, enclosed = _clearance(scene, eyes, eye_height)
        clearance[enclosed < _ENCLOSED] = 0
        if clearance.max() > 0:
            best = _middle(eyes, np.flatnonzero(clearance > clearance.max() - _EQUAL))
            return CameraPlace(eyes[best], float(clearance[best]))
    mend = "check its scale and which axis is up, or give the floor's height"
    place = f"{eye_height} m above {floor:.2f} m and between walls"
    raise InputError(f"{scene.name} has no place to stand, {place}: {mend}")


def _middle(eyes: np.ndarray, equals: np.ndarray) -> int:
    """Of places that are as good, the one nearest to their mean; of those, the first."""
    away = np.linalg.norm(eyes[equals] - eyes[equals].mean(axis=0), axis=1)
    return int(equals[np.flatnonzero(away < away.min() + _EQUAL)[0]])


def _grid(scene: MeshScene, height: float) -> np.ndarray:
    """(n, 3) places, row by row, half a step inside the bounds."""
    low, high = scene.bounds[:, :2]
    counts = np.clip(((high - low) / _GRID_STEP).astype(int), 1, _GRID_SIZE)
    x, y = (l + (np.arange(n) + 0.5) * (h - l) / n for l, h, n in zip(low, high, counts, strict=True))
    places = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    return np.concatenate([places, np.full((len(places), 1), height)], axis=1)


def _between_floor_and_roof(scene: MeshScene, eyes: np.ndarray, eye_height: float) -> np.ndarray:
    below, above = (scene.cast(eyes, np.tile([0.0, 0.0, way], (len(eyes), 1))) for way in (-1.0, 1.0))
    return (np.abs(below.distance - eye_height) < _ON_FLOOR) & (above.triangle >= 0)


def _clearance(scene: MeshScene, eyes: np.ndarray, eye_height: float) -> tuple[np.ndarray, np.ndarray]:
    """(n,) metres to the nearest thing, inf without one, and (n,) the share of rays at eye height that meet one."""
    angle = np.arange(_AZIMUTHS) * 2 * np.pi / _AZIMUTHS
    round_about = np.stack([np.cos(angle), np.sin(angle), np.zeros(_AZIMUTHS)], axis=1)
    rays = np.tile(round_about, (len(eyes), 1))
    nearest = np.full(len(eyes), np.inf)
    for level in (*_LEVELS, eye_height):
        origins = np.repeat(eyes + np.array([0, 0, level - eye_height]), _AZIMUTHS, axis=0)
        hits = scene.cast(origins, rays)
        free = np.where(hits.triangle >= 0, hits.distance, np.inf).reshape(-1, _AZIMUTHS)
        nearest = np.minimum(nearest, free.min(axis=1))
    return nearest, np.isfinite(free).mean(axis=1)
