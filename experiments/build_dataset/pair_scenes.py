"""Where a dataset's clips are walked: in rooms drawn by key, or in scenes that the user has."""

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

MESHES = (".glb", ".gltf", ".obj")


@dataclasses.dataclass(frozen=True)
class SceneConfig:
    """Scenes instead of drawn rooms."""

    folder: str | None = None  # of glTF, GLB or OBJ files, or of 3D-FRONT's house JSONs; none = rooms are drawn
    models: str | None = None  # 3D-FRONT: the folder of 3D-FUTURE-model
    textures: str | None = None  # 3D-FRONT: the folder of 3D-FRONT-texture
    up: str = "y"  # of mesh files
    scale: float = 1.0  # metres a unit of mesh files


Walk = Callable[[jax.Array], Drawn]  # the pair of a key; raises InputError where there is no path


def clip_walks(scenes: SceneConfig, pairs: PairConfig, clips: int) -> Callable[[int], tuple[str, Walk]]:
    """The place of clip i of `clips`, by name, and how a pair is made there; each scene has its share, one after
    another. Raises InputError where the folder holds none."""
    if scenes.folder is None:
        return lambda index: ("rooms", partial(make_pair, config=pairs))
    places = scene_places(scenes)
    share = -(-clips // len(places))
    open_scene = lru_cache(maxsize=1)(lambda number: _standing(places[number], scenes))

    def clip(index: int) -> tuple[str, Walk]:
        path, room = places[index // share]
        name = path.name if room is None else f"{path.name} {room}"
        return name, lambda key: scene_pair(key, open_scene(index // share), pairs)

    return clip


def scene_places(scenes: SceneConfig) -> list[tuple[Path, str | None]]:
    """(file, room) in the order of their names; the room is None for a mesh file."""
    folder = Path(scenes.folder)
    if not folder.is_dir():
        raise InputError(f"scenes.folder {folder} is no folder: give the one that holds the scenes, or none")
    found = [(path, None) for path in sorted(folder.iterdir()) if path.suffix.lower() in MESHES]
    if scenes.models is not None:
        found += [(path, room) for path in sorted(folder.glob("*.json")) for room in room_names(path)]
    if not found:
        mend = "3D-FRONT's houses also need scenes.models"
        raise InputError(f"scenes.folder {folder} holds no {', '.join(MESHES)} file; {mend}")
    return found


def _standing(place: tuple[Path, str | None], scenes: SceneConfig) -> Callable:
    """How the place is seen from a pose, the world's origin at eye height where most is clear."""
    path, room = place
    if room is None:
        scene = read_mesh_scene(path, up=scenes.up, scale=scenes.scale)
    else:
        scene = read_front(path, scenes.models, textures=scenes.textures, room=room)
    return partial(_look, scene.at(find_camera_place(scene).eye))


def _look(scene: MeshScene, pose: jax.Array, rows: int) -> tuple[np.ndarray, np.ndarray]:
    return scene.trace(np.asarray(pose), rows)
