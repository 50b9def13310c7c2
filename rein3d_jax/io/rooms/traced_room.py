"""A room with ground truth: scene.json names an input panorama, pinhole views, panoramas elsewhere and video frames.

scene.json   input {rgb, distance}; views [{rgb, c2w, fx, fy, cx, cy, width, height}]; panos [{rgb, distance, c2w}];
             video [{rgb, c2w}]. The last three may be missing. All in the frame of conventions.py, the origin at the
             input. A view's c2w is of OpenCV camera axes; a panorama's is of axes that look along +X, so that the
             identity is the input's own: here both become world_from_camera, of OpenCV axes.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np

from rein3d_jax.conventions import PINHOLE
from rein3d_jax.errors import InputError
from rein3d_jax.io.files.json_file import path_within, read_json
from rein3d_jax.io.pictures.decode import open_image
from rein3d_jax.io.pictures.distance import read_distance
from rein3d_jax.io.pictures.photo import read_rgb
from rein3d_jax.io.rooms.posed_panorama import PosedPanorama, panorama_pose, rigid_pose
from rein3d_jax.scene import Camera, Panorama


@dataclass(frozen=True)
class View:
    """A picture taken in the room, and the camera that took it."""

    name: str
    rgb: np.ndarray  # (h, w, 3) sRGB
    camera: Camera


@dataclass(frozen=True)
class VideoFrame:
    """A panorama of a film through the room."""

    name: str
    rgb: np.ndarray  # (h, 2 h, 3) sRGB
    world_from_camera: np.ndarray  # (4, 4) float64


@dataclass(frozen=True)
class TracedRoom:
    """All that a room's folder holds; the input stands at the world's origin."""

    input: PosedPanorama
    views: tuple[View, ...]
    panos: tuple[PosedPanorama, ...]
    video: tuple[VideoFrame, ...]  # all of one size


def read_traced_room(path: str | Path) -> TracedRoom:
    """The room whose scene.json is `path`, or lies in it. Raises InputError, naming the file: missing, damaged, of
    another size than scene.json or its own distance says, a matrix that is no pose, a path out of the folder."""
    path = Path(path)
    path = path / "scene.json" if path.is_dir() else path
    scene = read_json(path)
    with _faults_named(path, "a room", "input with rgb and distance"):
        start = _pano(path, {"c2w": np.eye(4)} | scene["input"])
    views = read_posed_views(path) if "views" in scene else ()
    with _faults_named(path, "a list of panos", "rgb, distance, c2w each"):
        panos = tuple(_pano(path, entry) for entry in scene.get("panos", ()))
    with _faults_named(path, "a list of video frames", "rgb, c2w each"):
        size = _first_size(path, scene.get("video", ()))
        video = tuple(_frame(path, entry, size) for entry in scene.get("video", ()))
    return TracedRoom(start, views, panos, video)


def read_posed_views(path: str | Path, *, anywhere: bool = False) -> tuple[View, ...]:
    """The views of the scene.json at `path`; `anywhere`: their files may lie outside its folder. Raises InputError
    as `read_traced_room` does."""
    path = Path(path)
    scene = read_json(path)
    with _faults_named(path, "a list of views", "rgb, c2w, fx, fy, cx, cy each"):
        return tuple(_view(path, entry, anywhere) for entry in scene["views"])


@contextmanager
def _faults_named(path: Path, wanted: str, needs: str) -> Iterator[None]:
    """What goes wrong in data of an unexpected shape, as one line."""
    try:
        yield
    except InputError:
        raise
    except (AttributeError, KeyError, TypeError, ValueError, OverflowError) as error:
        reason = " ".join(repr(error).split())
        raise InputError(f"{path}: not {wanted} ({reason}); it needs {needs}") from error


def _view(path: Path, entry: dict[str, Any], anywhere: bool) -> View:
    pose = rigid_pose(entry["c2w"])
    numbers = np.asarray([entry[name] for name in ("fx", "fy", "cx", "cy")], np.float32)
    if not np.isfinite(numbers).all() or numbers[:2].min() <= 0:
        raise ValueError("fx and fy must be positive, cx and cy finite")
    file = path.parent / entry["rgb"] if anywhere else path_within(path.parent, entry["rgb"], named_by=path)
    width, height = _size(file)
    _check_size(file, (width, height), (entry.get("width", width), entry.get("height", height)), path)
    rgb = read_rgb(file, panorama=False)
    pose, focal, centre = (jnp.asarray(x, jnp.float32) for x in (pose, numbers[:2], numbers[2:]))
    return View(entry["rgb"], rgb, Camera(pose, focal, centre, PINHOLE, width, height))


def _pano(path: Path, entry: dict[str, Any]) -> PosedPanorama:
    pose = _pano_pose(entry["c2w"])
    rgb, distance = (path_within(path.parent, entry[name], named_by=path) for name in ("rgb", "distance"))
    picture = read_rgb(rgb)
    metres, valid = read_distance(distance, picture.shape[:2])  # a truth of another size is another picture's
    return PosedPanorama(entry["rgb"], Panorama(*map(jnp.asarray, (picture, metres, valid))), pose)


def _frame(path: Path, entry: dict[str, Any], size: tuple[int, int]) -> VideoFrame:
    pose = _pano_pose(entry["c2w"])
    file = path_within(path.parent, entry["rgb"], named_by=path)
    _check_size(file, _size(file), size, path)
    return VideoFrame(entry["rgb"], read_rgb(file), pose)


def _pano_pose(c2w: object) -> np.ndarray:
    """A panorama's c2w, of axes that look along +X, as world_from_camera."""
    pose = rigid_pose(c2w)
    return panorama_pose(pose[:3, :3], pose[:3, 3])


def _first_size(path: Path, entries: list[dict[str, Any]]) -> tuple[int, int]:
    """(width, height) of the film's first frame, which all others must have."""
    return _size(path_within(path.parent, entries[0]["rgb"], named_by=path)) if entries else (0, 0)


def _size(file: Path) -> tuple[int, int]:
    with open_image(file) as image:
        return image.spec().width, image.spec().height


def _check_size(file: Path, found: tuple[int, int], wanted: tuple[int, int], path: Path) -> None:
    if found != wanted:
        has, needs = ("x".join(map(str, size)) for size in (found, wanted))
        raise InputError(f"{file} is {has}, but {path} needs {needs}: render it again at that size")
