"""A folder of panoramas of one's own: NAME.png | .jpg | .exr | .hdr beside NAME_distance.exr | .png (16 bits, mm) |
.npy | .npz, and, where they share a world, poses.json: {"NAME": world_from_camera as 4 rows of 4 numbers}."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.json_file import read_json
from rein3d_jax.io.rooms.posed_panorama import PosedPanorama, pose_of_turn, read_panorama, rigid_pose

PICTURES = (".png", ".jpg", ".jpeg", ".exr", ".hdr")
DISTANCES = (".exr", ".png", ".npy", ".npz")
POSES = "poses.json"
_SUFFIX = "_distance"


def read_folder(folder: str | Path, *, height: int | None = None) -> Iterator[PosedPanorama]:
    """The panoramas of `folder`, sorted by name, each read when asked for. Without poses.json each stands unturned
    at the origin of a world of its own. Poses are of OpenCV camera axes, in metres, Z up.

    Raises InputError at once if the folder has no panorama, a picture without its distance, two files of one name,
    or poses.json does not fit; and at the panorama that is damaged or of another size than its distance.
    """
    folder = Path(folder)
    pairs = _pairs(folder)
    poses = _poses(folder / POSES, list(pairs))
    return (PosedPanorama(name, read_panorama(*pair, height), poses[name]) for name, pair in pairs.items())


def _pairs(folder: Path) -> dict[str, tuple[Path, Path]]:
    if not folder.is_dir():
        raise InputError(f"{folder} is no folder: give one of NAME.png and NAME{_SUFFIX}.exr pairs")
    files = sorted(path for path in folder.iterdir() if path.is_file() and not path.name.startswith("."))
    pictures = [path for path in files if path.suffix.lower() in PICTURES and not path.stem.endswith(_SUFFIX)]
    if not pictures:
        raise InputError(f"{folder} holds no panorama: put NAME.png and NAME{_SUFFIX}.exr pairs into it")
    names = [path.stem for path in pictures]
    for path in pictures:
        if names.count(path.stem) > 1:
            raise InputError(f"{path} is one of {names.count(path.stem)} pictures of that name: keep one of them")
    return {path.stem: (path, _distance_of(path, files)) for path in pictures}


def _distance_of(picture: Path, files: list[Path]) -> Path:
    stem = picture.stem + _SUFFIX
    found = [path for path in files if path.stem == stem and path.suffix.lower() in DISTANCES]
    if not found:
        raise InputError(f"{picture} has no distance: put {stem}.exr (or .png in mm, .npy, .npz) beside it")
    if len(found) > 1:
        raise InputError(f"{picture} has {len(found)} distance maps ({', '.join(p.name for p in found)}): keep one")
    return found[0]


def _poses(path: Path, names: list[str]) -> dict[str, np.ndarray]:
    if not path.exists():
        return {name: pose_of_turn(np.eye(3), np.zeros(3)) for name in names}
    given = read_json(path)
    if not isinstance(given, dict):
        raise InputError(f'{path} must be an object, {{"NAME": 4x4 world_from_camera}}')
    if unlike := set(names) ^ set(given):
        name = min(unlike)
        fault, mend = ("no pose", "add one") if name in names else ("a pose but no picture", "remove it")
        raise InputError(f"{path}: {name} has {fault}: {mend}")
    return {name: _pose(path, name, given[name]) for name in names}


def _pose(path: Path, name: str, matrix: object) -> np.ndarray:
    try:
        return rigid_pose(matrix)
    except (ValueError, TypeError) as error:
        raise InputError(f"{path}: {name}: {' '.join(str(error).split())}") from error
