"""3D-FRONT houses (Fu et al. 2021) with 3D-FUTURE furniture, as published: a house's JSON names meshes (walls,
floors, ceilings) and models; rooms say which, and where models stand.

A model's vertices v go to R(rot) (scale * v) + pos, rot being the quaternion x, y, z, w, and meshes stand where they
are; all in metres with Y up. So 3D-FRONT-ToolBox (scripts/utils.py: transform_v, quaternion_to_matrix;
scripts/scene.py) places them; BlenderProc's Front3DLoader swaps two axes of the meshes instead of rotating them, which
mirrors the house, and is not followed. Texture coordinates are multiplied by the upper left 2 x 2 of the material's
UVTransform. A model is <models>/<jid>/raw_model.obj with its model.mtl and texture.png; a material's texture is
<textures>/<jid>/texture.png, and is never downloaded: without it the material's colour stands in, and
MeshScene.missing says so.
"""

from pathlib import Path
from typing import Any

import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.json_file import path_within, read_json
from rein3d_jax.io.meshes.mesh_file import read_mesh
from rein3d_jax.io.pictures.image import to_uint8
from rein3d_jax.io.pictures.photo import read_rgb
from rein3d_jax.meshes.mesh_scene import MeshScene, mesh_scene
from rein3d_jax.meshes.texture import Texture, texture
from rein3d_jax.meshes.triangles import Triangles, join_triangles, transformed, triangles, z_up

_UNPAINTED = (220, 220, 220)  # 3D-FRONT-ToolBox's default


def room_names(path: str | Path) -> list[str]:
    """The instanceid of every room of the house at `path`, in its order. Raises InputError."""
    path = Path(path)
    try:
        return [str(room["instanceid"]) for room in read_json(path)["scene"]["room"]]
    except (KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{path} is no house of 3D-FRONT ({error!r}): it needs scene.room[].instanceid") from error


def read_front(
    path: str | Path, models: str | Path, *, textures: str | Path | None = None, room: str | None = None
) -> MeshScene:
    """The house whose JSON is `path`, or only its `room`, with the furniture of the folder `models` and the wall
    textures of the folder `textures`: Z up, in metres. What those folders lack is left out (a texture: painted
    plain) and listed in `missing`. Raises InputError, naming the file, for anything damaged, for a folder that is
    missing, and for a room that the house has not."""
    path, models = Path(path), Path(models)
    folders = [models] if textures is None else [models, Path(textures)]
    for folder in folders:
        if not folder.is_dir():
            raise InputError(f"{folder} is no folder: give 3D-FUTURE's models and 3D-FRONT's textures as folders")
    house = _House(path, models, None if textures is None else Path(textures))
    try:
        parts = house.parts(room)
    except InputError:
        raise
    except (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError) as error:
        reason = " ".join(repr(error).split())
        raise InputError(f"{path} is no house of 3D-FRONT ({reason}): copy it again") from error
    return mesh_scene(path, z_up(join_triangles(parts, path)), tuple(sorted(house.missing)))


class _House:
    """One house's tables, and what was read for it so far."""

    def __init__(self, path: Path, models: Path, textures: Path | None):
        self.path, self.models, self.textures = path, models, textures
        self.data: dict[str, Any] = read_json(path)
        self.missing: set[str] = set()
        self._models: dict[str, Triangles | None] = {}
        self._pictures: dict[str, Texture | None] = {}

    def parts(self, room: str | None) -> list[Triangles]:
        meshes = {mesh["uid"]: mesh for mesh in self.data["mesh"]}
        materials = {material["uid"]: material for material in self.data.get("material", ())}
        # The toolbox wants "valid" to be true, BlenderProc never asks: what is not said to be invalid is searched for.
        furniture = {item["uid"]: item["jid"] for item in self.data.get("furniture", ()) if item.get("valid", True)}
        parts = []
        for child in self._children(room):
            if child["ref"] in meshes:
                mesh = meshes[child["ref"]]
                parts.append(self._mesh(mesh, materials.get(mesh.get("material"))))
            elif child["ref"] in furniture and (model := self._model(furniture[child["ref"]])) is not None:
                parts.append(transformed(model, _place(child)))
        return parts

    def _children(self, room: str | None) -> list[dict[str, Any]]:
        """Those of the room, or of all; a wall that two rooms name comes once."""
        rooms = {each["instanceid"]: each for each in self.data["scene"]["room"]}
        if room is not None and room not in rooms:
            raise InputError(f"{self.path} has no room {room!r}: it has {', '.join(rooms)}")
        children = [child for name in rooms if room in (None, name) for child in rooms[name]["children"]]
        return list(
            {(child["ref"], str(child.get("pos")), str(child.get("rot"))): child for child in children}.values()
        )

    def _mesh(self, mesh: dict[str, Any], material: dict[str, Any] | None) -> Triangles:
        xyz, faces = (
            np.reshape(np.asarray(mesh[key], kind), (-1, 3)) for key, kind in (("xyz", "f8"), ("faces", "i8"))
        )
        material = material or {}
        uv = [] if None in mesh.get("uv", ()) else mesh.get("uv", [])
        uv = np.reshape(np.asarray(uv, np.float64), (-1, 2)) if len(uv) else None
        if uv is not None and "UVTransform" in material:
            uv = uv @ np.reshape(np.asarray(material["UVTransform"], np.float64), (3, 3))[:2, :2].T
        picture = self._picture(material) if uv is not None else None
        colour = np.asarray((material.get("color") or _UNPAINTED)[:3], np.float32) / 255
        return triangles(xyz, faces, uv, np.ones(3) if picture else colour, picture)

    def _picture(self, material: dict[str, Any]) -> Texture | None:
        jid = str(material.get("jid") or "")
        if not material.get("texture") or not jid:
            return None
        if jid not in self._pictures:
            name, folder = f"{jid}/texture.png", self.textures
            file = None if folder is None else path_within(folder, name, named_by=self.path)
            self._pictures[jid] = _read_texture(file) if file is not None and file.is_file() else None
            if self._pictures[jid] is None:
                self.missing.add(f"texture {jid}")
        return self._pictures[jid]

    def _model(self, jid: str) -> Triangles | None:
        if jid not in self._models:
            file = path_within(self.models, f"{jid}/raw_model.obj", named_by=self.path)
            self._models[jid] = read_mesh(file, up="z") if file.is_file() else None  # Y up stays till the end
            if self._models[jid] is None:
                self.missing.add(f"model {jid}")
        return self._models[jid]


def _read_texture(file: Path) -> Texture:
    return texture(to_uint8(read_rgb(file, panorama=False)))


def _place(child: dict[str, Any]) -> np.ndarray:
    """(4, 4) house from model, Y up: R(rot) diag(scale), pos."""
    rot, pos, scale = (np.asarray(child[key], np.float64) for key in ("rot", "pos", "scale"))
    norm = np.linalg.norm(rot)
    if rot.shape != (4,) or pos.shape != (3,) or scale.shape != (3,) or not (np.isfinite(norm) and norm > 0):
        raise ValueError(f"a child of {child['ref']} needs pos (3), scale (3) and a quaternion rot (4)")
    x, y, z, w = rot / norm
    pose = np.eye(4)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    pose[:3, :3] = (np.eye(3) + 2 * w * cross + 2 * cross @ cross) * scale
    pose[:3, 3] = pos
    return pose
