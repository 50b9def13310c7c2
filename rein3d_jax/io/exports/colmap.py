"""A COLMAP text model: images/, masks/ (NAME.png.png, as COLMAP names them), sparse/0/{cameras,images,points3D}.txt.

Poses are world to camera, OpenCV axes, quaternions wxyz; the first pixel's centre is (0.5, 0.5), as ours.
Source: colmap.github.io/format.html.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rein3d_jax.io.exports.point_cloud import Points
from rein3d_jax.io.exports.posed_picture import PosedPicture, write_posed_picture
from rein3d_jax.io.files.atomic import write_text

_MAX_SEEN = 500  # points an image is said to see: tracks show the model, they are not for bundle adjustment
_SAME_PLACE = 0.02  # relative; farther off than this a point is hidden, or was moved by refinement


@dataclass(frozen=True)
class _Image:
    name: str
    pose: np.ndarray  # camera_from_world (4, 4)
    camera: str  # the line of cameras.txt without its number
    pixels: np.ndarray  # (k, 2) where the points `seen` are
    seen: np.ndarray  # (k,) int


def write_colmap(folder: Path, pictures: Iterable[PosedPicture], points: Points) -> int:
    """Writes the model, images.txt last. Returns how many pictures there were. Raises InputError where a file cannot be
    written."""
    images = [_image(folder, picture, points) for picture in pictures]
    cameras = list(dict.fromkeys(image.camera for image in images))
    model = folder / "sparse" / "0"
    write_text(model / "cameras.txt", "".join(f"{i} {line}\n" for i, line in enumerate(cameras, start=1)))
    write_text(model / "points3D.txt", "".join(_point_lines(points, images)))
    lines = (_image_lines(number, image, cameras) for number, image in enumerate(images, start=1))
    write_text(model / "images.txt", "".join(lines))
    return len(images)


def quaternion(rotation: np.ndarray) -> np.ndarray:
    """Quaternion (4,) wxyz, w >= 0, of the rotation nearest to `rotation` (3, 3): the eigenvector of Bar-Itzhack's K,
    "New method for extracting the quaternion from a rotation matrix" (2000). Poses are rotations up to float32's
    rounding, which geometry's quats_from_matrix, for true rotations, passes on: a difference of 5e-9 in images.txt."""
    m = np.asarray(rotation, np.float64)
    k = np.empty((4, 4))
    k[1:, 1:] = m + m.T - np.trace(m) * np.eye(3)
    k[0, 1:] = k[1:, 0] = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
    k[0, 0] = np.trace(m)
    vector = np.linalg.eigh(k)[1][:, -1]
    return vector if vector[0] >= 0 else -vector


def _image(folder: Path, picture: PosedPicture, points: Points) -> _Image:
    camera, name = picture.camera, write_posed_picture(folder, picture, ".png.png")
    numbers = [*np.asarray(camera.focal, np.float64), *np.asarray(camera.centre, np.float64)]
    line = f"PINHOLE {camera.width} {camera.height} {' '.join(map(repr, map(float, numbers)))}"
    return _Image(name, np.linalg.inv(picture.pose), line, *_seen(picture, points.places))


def _seen(picture: PosedPicture, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pixels (k, 2) and indices (k,) of points that the picture shows: they are as far as it is there."""
    local = (places - picture.pose[:3, 3]) @ picture.pose[:3, :3]
    ahead = np.flatnonzero(local[:, 2] > 1e-3)
    local, camera = local[ahead], picture.camera
    pixels = local[:, :2] / local[:, 2:] * np.asarray(camera.focal) + np.asarray(camera.centre)
    inside = ((pixels >= 0) & (pixels < (camera.width, camera.height))).all(axis=1)
    u, v = pixels[inside].astype(int).T
    off = np.linalg.norm(local[inside], axis=1) - picture.distance[v, u]
    shown = np.flatnonzero(inside)[(np.abs(off) < _SAME_PLACE * picture.distance[v, u]) & picture.known[v, u]]
    shown = shown[:: max(1, -(-len(shown) // _MAX_SEEN))]
    return pixels[shown], ahead[shown]


def _image_lines(number: int, image: _Image, cameras: list[str]) -> str:
    pose = [*quaternion(image.pose[:3, :3]), *image.pose[:3, 3]]
    seen = (f"{u:.3f} {v:.3f} {index + 1}" for (u, v), index in zip(image.pixels, image.seen, strict=True))
    head = " ".join(repr(float(value)) for value in pose)
    return f"{number} {head} {cameras.index(image.camera) + 1} {image.name}\n{' '.join(seen)}\n"


def _point_lines(points: Points, images: list[_Image]) -> Iterable[str]:
    tracks: list[list[str]] = [[] for _ in points.places]
    for number, image in enumerate(images, start=1):
        for place, index in enumerate(image.seen):
            tracks[index].append(f"{number} {place}")
    rows = zip(points.places, points.colours, tracks, strict=True)
    for index, (place, colour, track) in enumerate(rows, start=1):
        yield f"{' '.join([str(index), *(f'{x:.6f}' for x in place), *map(str, colour), '0', *track])}\n"
