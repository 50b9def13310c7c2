"""The surface of a signed distance field as triangles (scikit-image's marching cubes) in a GLB file (trimesh)."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.geometry.colour import linear_from_srgb
from rein3d_jax.io.files.atomic import write_bytes
from rein3d_jax.io.pictures.image import to_uint8

_MEND = "pip install 'rein3d-jax[export]'"
Y_UP_FROM_Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # glTF's, as Blender undoes it


@dataclass(frozen=True)
class Surface:
    """Triangles whose fronts face free space, Z up."""

    vertices: np.ndarray  # (v, 3) metres
    faces: np.ndarray  # (f, 3) int
    colours: np.ndarray  # (v, 3) sRGB


def extract_surface(
    signed: np.ndarray, known: np.ndarray, rgb: np.ndarray, low: np.ndarray, voxel: float, *, jump: float = np.inf
) -> Surface:
    """Surface where `signed` (x, y, z) metres passes 0 between samples that are all `known` and differ by less than
    `jump`: a larger one is the outline of something before an unseen place. The first sample is at `low` (3,), the
    others `voxel` metres apart. Raises InputError without scikit-image, or where there is no surface."""
    try:
        from skimage.measure import marching_cubes
    except ImportError as error:
        raise InputError(f"a mesh needs scikit-image and trimesh: {_MEND}") from error
    signed = np.array(signed)  # scikit-image wants it writable
    low_corner, high_corner = _of_cells(signed, np.minimum), _of_cells(signed, np.maximum)
    cells = _of_cells(np.asarray(known), np.logical_and) & (high_corner - low_corner < jump)
    if not (cells.any() and signed.min() < 0 < signed.max()):
        raise InputError("the scene has no surface that could become a mesh: render it from nearer, or lower --voxel")
    # Its mask is asked at the sample where a cell ends.
    mask = np.pad(cells, ((1, 0),) * 3)
    vertices, faces, _, _ = marching_cubes(signed, 0.0, mask=mask, gradient_direction="descent")
    nearest = np.round(vertices).astype(int)
    return Surface(np.asarray(low) + vertices * voxel, faces, np.asarray(rgb)[tuple(nearest.T)])


def without_islands(surface: Surface, area: float) -> Surface:
    """The parts that hang together over `area` square metres or more. Raises InputError without trimesh, or where
    nothing is left."""
    trimesh = _trimesh()
    mesh = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
    groups = trimesh.graph.connected_components(mesh.face_adjacency, nodes=np.arange(len(surface.faces)))
    large = [group for group in groups if mesh.area_faces[group].sum() >= area]
    if not large:
        raise InputError(f"no part of the mesh has {area} square metres: lower --island")
    faces = surface.faces[np.sort(np.concatenate(large))]
    used, numbered = np.unique(faces, return_inverse=True)
    return Surface(surface.vertices[used], numbered.reshape(faces.shape), surface.colours[used])


def write_glb(path: Path, surface: Surface) -> None:
    """Writes the mesh, Y up as glTF wants and with linear colours, atomically. Raises InputError."""
    mesh = _trimesh().Trimesh(surface.vertices @ Y_UP_FROM_Z_UP.T, surface.faces, process=False)
    opaque = np.full((len(surface.colours), 1), 255, np.uint8)
    mesh.visual.vertex_colors = np.hstack([to_uint8(linear_from_srgb(np.clip(surface.colours, 0, 1))), opaque])
    write_bytes(path, mesh.export(file_type="glb"))


def _of_cells(samples: np.ndarray, join: np.ufunc) -> np.ndarray:
    """(x - 1, y - 1, z - 1): `join` over each cell's eight corners, one axis after another."""
    for _ in range(3):
        samples = np.moveaxis(join(samples[:-1], samples[1:]), 0, -1)
    return samples


def _trimesh():
    try:
        import trimesh
    except ImportError as error:
        raise InputError(f"a mesh needs scikit-image and trimesh: {_MEND}") from error
    return trimesh
