"""Closed solids, by manifold3d: whatever is cut from them or joined to them stays closed."""

from types import ModuleType
from typing import Any

import numpy as np

from rein3d_jax.errors import InputError


def manifold_library() -> ModuleType:
    """The module manifold3d. Raises InputError without it."""
    try:
        import manifold3d
    except ImportError as error:
        raise InputError("a collider needs manifold3d: pip install 'rein3d-jax[export]'") from error
    return manifold3d


def closed_solid(vertices: np.ndarray, faces: np.ndarray) -> Any:
    """The Manifold of a closed mesh, fronts facing outwards: vertices (v, 3) metres, faces (f, 3) int. Raises
    InputError where an edge has not two faces."""
    library = manifold_library()
    mesh = library.Mesh64(np.ascontiguousarray(vertices, np.float64), np.ascontiguousarray(faces, np.uint64))
    solid = library.Manifold(mesh)
    if solid.status() != library.Error.NoError:
        raise InputError(f"a mesh of {len(faces)} triangles is not closed ({solid.status().name}): mend its edges")
    return solid


def box_solid(low: np.ndarray, high: np.ndarray) -> Any:
    """The Manifold of the box between two corners (3,)."""
    return manifold_library().Manifold.cube(np.subtract(high, low)).translate(np.asarray(low, np.float64))


def mesh_of_solid(solid: Any) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (v, 3) float64 and faces (f, 3) int of a Manifold, fronts facing outwards."""
    mesh = solid.to_mesh64()
    return np.array(mesh.vert_properties[:, :3], np.float64), np.array(mesh.tri_verts, np.int64)
