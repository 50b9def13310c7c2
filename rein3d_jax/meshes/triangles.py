"""A scene as one soup of triangles, Z up, in metres: what every mesh file becomes before it is traced."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.meshes.texture import Texture

MAX_TRIANGLES = 40_000_000  # at 144 bytes each, and embree's tree
_THINNEST = 1e-14  # square metres; a thinner triangle has no plane that can be relied on
_PLAIN = -1  # the texture index of a triangle without one
_Z_UP_FROM_Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


@dataclass(frozen=True)
class Triangles:
    """A soup of n triangles; two-sided, opaque."""

    corners: np.ndarray  # (n, 3, 3) float64 metres
    uv: np.ndarray  # (n, 3, 2) float32, 0 where plain
    colour: np.ndarray  # (n, 3) float32 sRGB, which the texture is multiplied by
    textured: np.ndarray  # (n,) int32 index into textures, or _PLAIN
    textures: tuple[Texture, ...]


def triangles(
    vertices: np.ndarray, faces: np.ndarray, uv: np.ndarray | None, colour: np.ndarray, picture: Texture | None
) -> Triangles:
    """One mesh: vertices (v, 3), faces (n, 3) int, uv (v, 2) or None, colour (3,) or (n, 3) sRGB. Raises ValueError
    for other shapes, faces out of range and values that are not finite."""
    vertices, faces = np.asarray(vertices, np.float64), np.asarray(faces, np.int64)
    if faces.shape[1:] != (3,) or vertices.shape[1:] != (3,):
        raise ValueError(f"faces of shape {faces.shape} and vertices of shape {vertices.shape} are no triangles")
    if faces.size and not 0 <= faces.min() <= faces.max() < len(vertices):
        raise ValueError(f"faces name vertex {faces.max() if faces.min() >= 0 else faces.min()} of {len(vertices)}")
    wraps = picture is not None and uv is not None
    if wraps and np.shape(uv) != (len(vertices), 2):
        raise ValueError(f"texture coordinates of shape {np.shape(uv)} for {len(vertices)} vertices")
    places = np.asarray(uv, np.float32)[faces] if wraps else np.zeros((len(faces), 3, 2), np.float32)
    corners = vertices[faces]
    if not (np.isfinite(corners).all() and np.isfinite(places).all()):
        raise ValueError("vertices or texture coordinates are not finite")
    colours = np.broadcast_to(np.asarray(colour, np.float32), (len(faces), 3))
    index = np.full(len(faces), 0 if wraps else _PLAIN, np.int32)
    return Triangles(corners, places, colours, index, (picture,) if wraps else ())


def join_triangles(parts: list[Triangles], path: Path) -> Triangles:
    """All parts as one, without triangles that have no area; a texture that several share is stored once. Raises
    InputError, naming `path`, for more than MAX_TRIANGLES and for none."""
    parts = [_with_area(part) for part in parts]
    total = sum(len(part.corners) for part in parts)
    if total > MAX_TRIANGLES:
        raise InputError(f"{path} has {total} triangles, more than {MAX_TRIANGLES}: simplify it, or give one room")
    if not total:
        raise InputError(f"{path} holds no triangle with an area: export the scene as a mesh")
    textures = list({id(picture): picture for part in parts for picture in part.textures}.values())
    place = {id(picture): index for index, picture in enumerate(textures)}
    textured = [_renumbered(part, place) for part in parts]
    fields = (np.concatenate([getattr(part, name) for part in parts]) for name in ("corners", "uv", "colour"))
    return Triangles(*fields, np.concatenate(textured), tuple(textures))


def transformed(soup: Triangles, pose: np.ndarray) -> Triangles:
    """The soup under an affine map (4, 4)."""
    return replace(soup, corners=soup.corners @ pose[:3, :3].T + pose[:3, 3])


def z_up(soup: Triangles) -> Triangles:
    """The soup with Z up of one with Y up: (x, -z, y)."""
    return replace(soup, corners=soup.corners @ _Z_UP_FROM_Y_UP.T)


def plane_normals(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals (n, 3) and areas (n,) of triangles with corners (n, 3, 3) and an area."""
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    doubled = np.linalg.norm(across, axis=1)
    return across / doubled[:, None], doubled / 2


def _with_area(part: Triangles) -> Triangles:
    with np.errstate(divide="ignore", invalid="ignore"):
        _, area = plane_normals(part.corners)
    thick = area > _THINNEST
    fields = {name: getattr(part, name)[thick] for name in ("corners", "uv", "colour", "textured")}
    return part if thick.all() else replace(part, **fields)


def _renumbered(part: Triangles, place: dict[int, int]) -> np.ndarray:
    indices = np.array([place[id(picture)] for picture in part.textures] + [_PLAIN], np.int32)  # _PLAIN is the last
    return indices[part.textured]
