"""What bounds a collider's free space as convex parts, for engines whose moving bodies meet no other meshes well: the
shell's six faces as slabs, and what stands in the room taken apart by V-HACD (Mamou), which works on voxels.

CoACD (coacd 1.0.14) makes fewer parts, but ended the whole process on 2 of some 30 solids."""

from typing import Any

import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.geometry.shell import world_from_shell
from rein3d_jax.meshes.collider import Collider
from rein3d_jax.meshes.free_space import shell_corners
from rein3d_jax.meshes.solid import box_solid, closed_solid, manifold_library, mesh_of_solid

_WALL = 0.2  # metres, a slab's thickness
_NAMES = ("back", "right", "floor", "front", "left", "ceiling")
_RIND = 1e-3  # metres inside the shell: nearer, rounding leaves films on the walls that join all that touches them
_CRUMB = 1e-3  # cubic metres; what is smaller stops nobody
_DETAIL = 0.02  # metres that do not matter then
_SPLINTER = 1e-6  # cubic metres of a part; V-HACD leaves some without any, whose fronts face anywhere
_MAX_PARTS = 16  # of one thing
_SAMPLES = 50_000  # voxels of one thing
_EXCESS = 5  # per cent that a part's hull may hold beyond it, lest it is cut again
_MAX_CORNERS = 64  # of a part, as PhysX takes them


def convex_parts(collider: Collider) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Vertices (v, 3), metres in the world, and faces (f, 3) of each part by its name, fronts outwards. Raises
    InputError without the extra `export`."""
    rotation = np.asarray(world_from_shell(collider.shell), np.float64)
    low, high = shell_corners(collider.shell)
    inside = closed_solid(collider.vertices @ rotation, collider.faces[:, ::-1])
    things = [each for each in (box_solid(low + _RIND, high - _RIND) - inside).decompose() if each.volume() > _CRUMB]
    parts = dict(zip(_NAMES, map(mesh_of_solid, _slabs(low, high)), strict=True))
    for thing, each in enumerate(things):
        parts |= {f"thing{thing}_part{part}": mesh for part, mesh in enumerate(_taken_apart(each))}
    return {name: (vertices @ rotation.T, faces) for name, (vertices, faces) in parts.items()}


def _slabs(low: np.ndarray, high: np.ndarray) -> list[Any]:
    """Boxes of thickness _WALL behind each face, and over its edges."""
    slabs = []
    for below in (True, False):
        for axis in range(3):
            ends = np.array([low - _WALL, high + _WALL])
            ends[int(below), axis] = low[axis] if below else high[axis]
            slabs.append(box_solid(*ends))
    return slabs


def _taken_apart(solid: Any) -> list[tuple[np.ndarray, np.ndarray]]:
    try:
        import vhacdx
    except ImportError as error:
        raise InputError("convex parts need vhacdx: pip install 'rein3d-jax[export]'") from error
    vertices, faces = mesh_of_solid(solid.simplify(_DETAIL))
    counted = np.insert(faces, 0, 3, axis=1).astype(np.uint32).ravel()  # each face after its number of corners
    sizes = {"maxConvexHulls": _MAX_PARTS, "resolution": _SAMPLES, "maxNumVerticesPerCH": _MAX_CORNERS}
    hulls = vhacdx.compute_vhacd(vertices, counted, asyncACD=False, minimumVolumePercentErrorAllowed=_EXCESS, **sizes)
    hull_of = manifold_library().Manifold.hull_points
    return [(corners, faces) for corners, faces in hulls if hull_of(corners).volume() > _SPLINTER]
