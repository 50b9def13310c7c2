"""Structured3D (Zheng et al. 2020) as it is published: one panorama a room, its distance and where it was taken.

scene_XXXXX/2D_rendering/<room>/panorama/camera_xyz.txt and .../{full,simple,empty}/{rgb_<light>light.png, depth.png}

Depth is 16-bit millimetres, 0 = no reading (data_organization.md of github.com/bertjiazheng/Structured3D). It is
along the ray: the PointCloudReader of its issue 9, to which issue 42 leads, places a pixel at camera_xyz + depth *
(cos l sin b, cos l cos b, sin l), camera_xyz in the same millimetres and b turning right from the centre column. So
the centre looks along +Y of a right-handed world with Z up. misc/panorama.py (xyz_2_coorxy, atan2(x, y)), with which
visualize_mesh.py papers the annotated walls, says the same; the sentence "always along the negative y-axis" of
data_organization.md contradicts both, and is not followed. It matters only where rooms of one scene are joined.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.input_file import require_file
from rein3d_jax.io.rooms.posed_panorama import PosedPanorama, pose_of_turn, read_panorama

FURNISHING = ("full", "simple", "empty")
LIGHTS = ("raw", "warm", "cold")
_METRES_PER_UNIT = 0.001
_FACING_Y = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # +X to +Y: a quarter turn left


def read_rooms(
    root: str | Path, *, furnishing: str = "full", light: str = "raw", height: int | None = None
) -> Iterator[PosedPanorama]:
    """The rooms under `root` (a folder of scenes, or one scene), sorted by scene and room, each read when asked for;
    `name` is "scene_XXXXX/<room>", the pose in the scene's world, in metres.

    Raises InputError at once where `root` holds no room, and at a room whose files are missing or damaged, naming
    the file. `height`: rows to bring pictures to.
    """
    for given, known, option in ((furnishing, FURNISHING, "furnishing"), (light, LIGHTS, "light")):
        if given not in known:
            raise InputError(f"{option} {given!r} must be one of {', '.join(known)}")
    folders = room_folders(Path(root))
    return (_read_room(folder, furnishing, light, height) for folder in folders)


def room_folders(root: Path) -> list[Path]:
    """The folders `2D_rendering/<room>` that hold a panorama, sorted. Raises InputError if there are none."""
    scenes = [root] if (root / "2D_rendering").is_dir() else sorted(root.glob("scene_*"))
    folders = [room for scene in scenes for room in sorted((scene / "2D_rendering").glob("*"))]
    rooms = [room for room in folders if (room / "panorama").is_dir()]
    if not rooms:
        layout = "scene_XXXXX/2D_rendering/<room>/panorama"
        raise InputError(f"{root} holds no {layout}: give the folder of Structured3D's scenes, or one of them")
    return rooms


def _read_room(room: Path, furnishing: str, light: str, height: int | None) -> PosedPanorama:
    folder = room / "panorama"
    position = _read_position(folder / "camera_xyz.txt")
    pictures = folder / furnishing
    panorama = read_panorama(pictures / f"rgb_{light}light.png", pictures / "depth.png", height)
    name = f"{room.parent.parent.resolve().name}/{room.name}"
    return PosedPanorama(name, panorama, pose_of_turn(_FACING_Y, position))


def _read_position(path: Path) -> np.ndarray:
    require_file(path)
    words = path.read_bytes()[:1024].split()  # three numbers; a damaged file may hold anything
    try:
        position = np.array([float(word) for word in words])
    except ValueError:
        position = np.full(3, np.nan)
    if position.shape != (3,) or not np.isfinite(position).all():
        raise InputError(f"{path} must hold three numbers, the camera's place in millimetres: copy it again")
    return position * _METRES_PER_UNIT
