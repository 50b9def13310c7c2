"""Panoramas with their distance, as data sets lay them out: Structured3D's, or a folder of one's own.

Structured3D (Zheng et al. 2020), the folder of its scenes or one scene, depth 16-bit millimetres along the ray:
    scene_XXXXX/2D_rendering/<room>/panorama/full/{rgb_rawlight.png, depth.png}
A folder of one's own:
    NAME.png | .jpg | .exr | .hdr beside NAME_distance.exr | .png (16 bits, mm) | .npy | .npz
"""

from pathlib import Path
from typing import NamedTuple

from rein3d_jax.errors import InputError

_PICTURES = (".png", ".jpg", ".jpeg", ".exr", ".hdr")
_DISTANCES = (".exr", ".png", ".npy", ".npz")
_SUFFIX = "_distance"


class PanoramaFiles(NamedTuple):
    """A panorama of a data set."""

    name: str  # "scene_XXXXX/<room>", or NAME
    rgb: Path
    distance: Path


def panorama_sets(folder: Path) -> list[PanoramaFiles]:
    """The panoramas in `folder`, sorted by name. Raises InputError where it has none, where a picture has no distance
    or two, and where two pictures are of one name; damaged files are found when they are read."""
    return _structured3d(folder) or _own(folder)


def _structured3d(folder: Path) -> list[PanoramaFiles]:
    scenes = [folder] if (folder / "2D_rendering").is_dir() else sorted(folder.glob("scene_*"))
    rooms = [(scene, room) for scene in scenes for room in sorted((scene / "2D_rendering").glob("*/panorama/full"))]
    return [
        PanoramaFiles(f"{scene.resolve().name}/{room.parts[-3]}", room / "rgb_rawlight.png", room / "depth.png")
        for scene, room in rooms
    ]


def _own(folder: Path) -> list[PanoramaFiles]:
    files = sorted(path for path in folder.iterdir() if path.is_file() and not path.name.startswith("."))
    pictures = [path for path in files if path.suffix.lower() in _PICTURES and not path.stem.endswith(_SUFFIX)]
    if not pictures:
        raise InputError(f"{folder} holds no panorama: put NAME.png and NAME{_SUFFIX}.exr pairs into it")
    names = [path.stem for path in pictures]
    for path in pictures:
        if names.count(path.stem) > 1:
            raise InputError(f"{path} is one of {names.count(path.stem)} pictures of that name: keep one of them")
    return [PanoramaFiles(path.stem, path, _distance_of(path, files)) for path in pictures]


def _distance_of(picture: Path, files: list[Path]) -> Path:
    stem = picture.stem + _SUFFIX
    found = [path for path in files if path.stem == stem and path.suffix.lower() in _DISTANCES]
    if not found:
        raise InputError(f"{picture} has no distance: put {stem}.exr (or .png in mm, .npy, .npz) beside it")
    if len(found) > 1:
        raise InputError(f"{picture} has {len(found)} distance maps ({', '.join(p.name for p in found)}): keep one")
    return found[0]
