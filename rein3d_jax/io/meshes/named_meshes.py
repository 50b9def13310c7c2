"""GLB files of meshes that nobody sees, a node for each by its name: what bodies collide with, where they walk."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import write_bytes
from rein3d_jax.io.meshes.surface_mesh import Y_UP_FROM_Z_UP


def write_named_meshes(path: Path, meshes: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> None:
    """Writes vertices (v, 3), metres with Z up, and faces (f, 3) by name, Y up as glTF wants, atomically. Raises
    InputError."""
    try:
        import trimesh
    except ImportError as error:
        raise InputError("a mesh needs trimesh: pip install 'rein3d-jax[export]'") from error
    scene = trimesh.Scene()
    for name, (vertices, faces) in meshes.items():
        mesh = trimesh.Trimesh(vertices @ Y_UP_FROM_Z_UP.T, faces, process=False)
        scene.add_geometry(mesh, node_name=name, geom_name=name)
    write_bytes(path, scene.export(file_type="glb"))
