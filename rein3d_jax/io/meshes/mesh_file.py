"""Textured meshes of any glTF, GLB or OBJ file, by trimesh, which here neither leaves the file's folder nor opens
an address, and unpickles nothing."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.geometry.colour import srgb_from_linear
from rein3d_jax.io.files.input_file import require_file
from rein3d_jax.io.files.json_file import path_within
from rein3d_jax.io.meshes.gltf_header import check_gltf
from rein3d_jax.io.pictures.photo import read_rgb
from rein3d_jax.meshes.mesh_scene import MeshScene, mesh_scene
from rein3d_jax.meshes.texture import Texture, texture
from rein3d_jax.meshes.triangles import MAX_TRIANGLES, Triangles, join_triangles, transformed, triangles, z_up

_PICTURES = (".png", ".jpg", ".jpeg")
_FORMATS = (".glb", ".gltf", ".obj")
_MEND = "pip install 'rein3d-jax[data]'"
_GREY = np.full(3, 0.8, np.float32)  # what has no colour of its own


def read_mesh(path: str | Path, *, up: str = "y", scale: float = 1.0) -> Triangles:
    """The triangles of a glTF, GLB or OBJ file: Z up, in metres.

    `up`: the file's vertical axis, "y" (as glTF says, and most OBJ) or "z"; `scale`: metres per unit. The colour is
    the base colour: textures, factors, colours of vertices (a face's mean); no lights. Raises InputError, naming
    the file: missing, damaged, empty, no mesh format, or it names a file that is missing or outside its folder.
    """
    path = Path(path)
    require_file(path)
    if path.suffix.lower() not in _FORMATS:
        raise InputError(f"{path} is no mesh by its suffix: give one of {', '.join(_FORMATS)}")
    if up not in ("y", "z") or not (np.isfinite(scale) and scale > 0):
        raise InputError(f"{path}: up {up!r} must be y or z, and scale {scale} positive")
    library = _trimesh()
    if path.suffix.lower() != ".obj":
        check_gltf(path)
    parts = _load(path, library)
    metres = np.diag([scale, scale, scale, 1.0])
    soup = join_triangles([transformed(part, metres) for part in parts], path)
    return z_up(soup) if up == "y" else soup


def read_mesh_scene(path: str | Path, *, up: str = "y", scale: float = 1.0) -> MeshScene:
    """The scene of a glTF, GLB or OBJ file; its own origin is the world's. Options and errors as read_mesh's."""
    return mesh_scene(path, read_mesh(path, up=up, scale=scale))


def _trimesh() -> ModuleType:
    try:
        import PIL.Image  # noqa: F401  without it trimesh leaves out every texture, and says nothing
        import trimesh
    except ImportError as error:
        raise InputError(f"reading meshes needs trimesh and Pillow: {_MEND}") from error
    return trimesh


def _load(path: Path, trimesh: ModuleType) -> list[Triangles]:
    faults: list[str] = []
    try:
        with open(path, "rb") as stream:
            resolver = _resolver(path, trimesh, faults)
            kind = path.suffix.lower()[1:]
            scene = trimesh.load_scene(stream, file_type=kind, resolver=resolver, allow_remote=False, process=False)
        parts = [] if faults else _parts(path, scene, kind != "obj")
    except InputError:
        raise
    except Exception as error:  # a parser of foreign bytes raises whatever its libraries raise
        if not faults:
            reason = " ".join(f"{type(error).__name__}: {error}".split())[:200]
            raise InputError(f"{path} is damaged or no {path.suffix[1:]} file ({reason}): export it again") from error
    if faults:  # trimesh goes on without a material or a texture that it cannot have
        raise InputError(faults[0])
    return parts


def _resolver(path: Path, trimesh: ModuleType, faults: list[str]) -> object:
    """What trimesh gets a mesh's other files from: its own folder, and nothing else."""

    class Folder(trimesh.resolvers.FilePathResolver):
        def get(self, name: str) -> bytes:
            try:
                file = path_within(path.parent, name.strip(), named_by=path)
                if not file.is_file():
                    raise InputError(f"{path} names the file {name.strip()!r}, which is not there: copy it beside it")
                if file.suffix.lower() in _PICTURES:
                    read_rgb(file, panorama=False)
                return file.read_bytes()
            except InputError as error:
                faults.append(str(error))
                raise FileNotFoundError(name) from error

    return Folder(str(path))


def _parts(path: Path, scene: object, linear: bool) -> list[Triangles]:
    """Every mesh of the scene's graph where it stands. `linear`: factors and vertex colours are light, not sRGB."""
    nodes = [scene.graph[node] for node in scene.graph.nodes_geometry]
    meshes = [(pose, scene.geometry[name]) for pose, name in nodes if hasattr(scene.geometry[name], "faces")]
    if sum(len(mesh.faces) for _, mesh in meshes) > MAX_TRIANGLES:
        raise InputError(f"{path} has more than {MAX_TRIANGLES} triangles: simplify it")
    pictures: dict[int, Texture] = {}
    encode: Callable = srgb_from_linear if linear else np.asarray
    return [transformed(_part(mesh, encode, pictures), pose) for pose, mesh in meshes]


def _part(mesh: object, encode: Callable, pictures: dict[int, Texture]) -> Triangles:
    visual = mesh.visual
    if visual.kind == "texture":
        image, colour = _material(visual.material, encode)
        return triangles(mesh.vertices, mesh.faces, visual.uv, colour, _decoded(image, pictures))
    colour = _GREY
    if visual.kind in ("vertex", "face"):
        colour = encode(np.asarray(visual.face_colors)[:, :3] / 255)
    return triangles(mesh.vertices, mesh.faces, None, colour, None)


def _material(material: object, encode: Callable) -> tuple[object, np.ndarray]:
    """The picture (or None) and the colour that multiplies it (or is all there is)."""
    if hasattr(material, "baseColorFactor"):
        image, factor = material.baseColorTexture, material.baseColorFactor
        return image, np.ones(3) if factor is None else encode(np.asarray(factor)[:3] / 255)
    if material.image is not None:
        return material.image, np.ones(3)  # OBJ: Kd beside a map is not used; exporters write 0 or 0.8 there
    return None, np.asarray(material.diffuse)[:3] / 255


def _decoded(image: object, pictures: dict[int, Texture]) -> Texture | None:
    """The picture as a texture, decoded once however many meshes wear it."""
    if image is not None and id(image) not in pictures:
        pictures[id(image)] = texture(np.asarray(image.convert("RGB")))
    return None if image is None else pictures[id(image)]
