"""Places of a dataset's clips: rooms drawn by key, or scenes that the user has."""

import dataclasses
from collections.abc import Callable
from functools import lru_cache, partial
from pathlib import Path

import jax
import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.io.meshes.front3d import read_front, room_names
from rein3d_jax.io.meshes.mesh_file import read_mesh_scene
from rein3d_jax.meshes.camera_place import find_camera_place
from rein3d_jax.meshes.mesh_scene import MeshScene
from rein3d_jax.pipeline.pairs import Drawn, PairConfig, make_pair, scene_pair
from rein3d_jax.settings import Settings, setting

_MESHES = (".glb", ".gltf", ".obj")


@dataclasses.dataclass(frozen=True)
class SceneConfig(Settings):
    """Scenes of one's own, in place of drawn rooms."""

    folder: str | None = setting(
        None, "glTF, GLB or OBJ files, or 3D-FRONT's house JSONs; none: rooms are drawn instead"
    )
    models: str | None = setting(None, "3D-FRONT: the folder 3D-FUTURE-model; none: JSONs are no scenes")
    textures: str | None = setting(None, "3D-FRONT: the folder 3D-FRONT-texture; none: plain walls and floors")
    up: str = setting("y", "axis that points up in mesh files", among=("y", "z"))
    scale: float = setting(1.0, "size of a mesh file's unit", within="(0, inf)", unit="metres")


PairSource = Callable[[jax.Array], Drawn]  # the pair of a key; raises InputError where the place has no path


def pair_sources(scenes: SceneConfig, pairs: PairConfig, clips: int) -> Callable[[int], tuple[str, PairSource]]:
    """The place of clip i of `clips`, by name, and the source of its pair; each scene has its share of the clips, one
    scene after another. Raises InputError where the folder holds none."""
    if scenes.folder is None:
        return lambda index: ("rooms", partial(make_pair, config=pairs))
    places = scene_places(scenes)
    share = -(-clips // len(places))
    open_scene = lru_cache(maxsize=1)(lambda number: _open(places[number], scenes))

    def source(index: int) -> tuple[str, PairSource]:
        path, room = places[index // share]
        name = path.name if room is None else f"{path.name} {room}"
        return name, lambda key: scene_pair(key, open_scene(index // share), pairs)

    return source


def scene_places(scenes: SceneConfig) -> list[tuple[Path, str | None]]:
    """(file, room) in the order of their names; the room is None for a mesh file."""
    folder = Path(scenes.folder)
    if not folder.is_dir():
        raise InputError(f"scenes.folder {folder} is no folder: give the one that holds the scenes, or none")
    found = [(path, None) for path in sorted(folder.iterdir()) if path.suffix.lower() in _MESHES]
    if scenes.models is not None:
        found += [(path, room) for path in sorted(folder.glob("*.json")) for room in room_names(path)]
    if not found:
        mend = "3D-FRONT's houses also need scenes.models"
        raise InputError(f"scenes.folder {folder} holds no {', '.join(_MESHES)} file; {mend}")
    return found


def _open(place: tuple[Path, str | None], scenes: SceneConfig) -> Callable:
    """The place as traced from a pose, the world's origin at eye height where most is clear."""
    path, room = place
    if room is None:
        scene = read_mesh_scene(path, up=scenes.up, scale=scenes.scale)
    else:
        scene = read_front(path, scenes.models, textures=scenes.textures, room=room)
    return partial(_trace, scene.at(find_camera_place(scene).eye))


def _trace(scene: MeshScene, pose: jax.Array, rows: int) -> tuple[np.ndarray, np.ndarray]:
    return scene.trace(np.asarray(pose), rows)
