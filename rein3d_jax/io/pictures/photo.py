"""A panorama as it was taken: its colours, what of the sphere they show, and how the camera stood."""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import OpenImageIO as oiio

from rein3d_jax.errors import InputError
from rein3d_jax.io.pictures.colour_profile import rec709_light, srgb_by_profile
from rein3d_jax.io.pictures.decode import MAX_COLUMNS, open_image, read_reduced
from rein3d_jax.io.pictures.gpano import Crop, Pose, crop_of, pose_of
from rein3d_jax.io.pictures.projection import is_sphere, what_it_shows, what_shape_is
from rein3d_jax.io.pictures.tone import tone_map

MIN_ROWS = 16
WORKING_COLUMNS = 8192  # nothing works at more than 4096 rows
_LINEAR = ("openexr", "hdr")  # formats that hold linear light
_SEEN = 0.5  # alpha
_BLACK = 0.02  # sRGB: darker than any wall of a room
_CAP = 0.03  # of the rows: a darker rim is not called a cap


def read_rgb(path: str | Path, *, panorama: bool = True) -> np.ndarray:
    """Equirectangular picture as float32 sRGB (h, 2 h, 3) in [0, 1], `read_photo`'s, what was not seen black; with
    `panorama` False, one of any aspect. Raises InputError as that does."""
    if panorama:
        return read_photo(path).rgb
    with open_image(Path(path)) as image:
        return _colours(Path(path), image, MAX_COLUMNS)[0]


@dataclass(frozen=True)
class Photo:
    """A panorama as it was taken."""

    rgb: np.ndarray  # (h, 2 h, 3) sRGB in [0, 1], black where not seen
    seen: np.ndarray  # (h, 2 h) bool
    pose: Pose  # as the file tells it
    rows: int  # `panorama_rows` of the file


def read_photo(path: str | Path) -> Photo:
    """The panorama in a file, at most WORKING_COLUMNS wide: more are averaged while they are read.

    JPEG, PNG, TIFF, WebP and BMP (8 or 16 bits, grey spread to three channels) are taken as sRGB unless they say
    otherwise (colour_profile.py); EXR and HDR as linear light, which is exposed and tone-mapped (tone.py). What is
    transparent, what was cropped away (GPano), and rows of nothing but black at either pole were not seen. A row or a
    column too many is scaled away. Raises InputError, before pixels are allocated where the header tells: missing, no
    picture, damaged, no panorama, under MIN_ROWS rows, over MAX_COLUMNS columns.
    """
    path = Path(path)
    with open_image(path) as image:
        spec = image.spec()
        crop = _checked_crop(path, spec)
        rgb, seen = _colours(path, image, WORKING_COLUMNS)
        pose, told = pose_of(spec), _rows(spec, crop)
    if crop is not None:
        rgb, seen = (_placed(x, crop, spec.width) for x in (rgb, seen))
    rows = min(len(rgb), rgb.shape[1] // 2)
    if rgb.shape[:2] != (rows, 2 * rows):
        rgb = cv2.resize(rgb, (2 * rows, rows), interpolation=cv2.INTER_AREA)
        seen = cv2.resize(seen.astype(np.uint8), (2 * rows, rows), interpolation=cv2.INTER_NEAREST) > 0
    if wrong := what_it_shows(rgb):
        raise InputError(f"{path} is no panorama but looks like {wrong}")
    seen &= ~_black_caps(rgb)
    return Photo(np.where(seen[..., None], rgb, np.float32(0)), seen, pose, told)


def panorama_rows(path: str | Path) -> int:
    """The rows of the equirectangular picture in a file, by its header. Raises InputError as `read_photo` does."""
    with open_image(Path(path)) as image:
        spec = image.spec()
        return _rows(spec, _checked_crop(Path(path), spec))


def _rows(spec: oiio.ImageSpec, crop: Crop | None) -> int:
    width, height = (spec.width, spec.height) if crop is None else (crop.width, crop.height)
    return min(height, width // 2) // -(-spec.width // WORKING_COLUMNS)


def _colours(path: Path, image: oiio.ImageInput, columns: int) -> tuple[np.ndarray, np.ndarray]:
    """Colours (h, w, 3), sRGB in [0, 1], and where (h, w) they are not transparent."""
    spec = image.spec()
    names = [name.upper() for name in spec.channelnames]
    channels, alpha = _colour_channels(path, names), _alpha_channel(names)
    pixels = read_reduced(path, image, columns)
    seen = np.ones(pixels.shape[:2], bool) if alpha is None else pixels[..., alpha] >= _SEEN
    rgb = pixels[..., channels]
    if image.format_name() in _LINEAR:
        primaries = spec.getattribute("chromaticities")
        return tone_map(rgb if primaries is None else rec709_light(rgb, tuple(primaries))), seen
    return srgb_by_profile(path, spec, rgb), seen


def _placed(part: np.ndarray, crop: Crop, columns: int) -> np.ndarray:
    """The panorama of which a picture, `columns` wide in its file, is the part; nothing in the rest. What leaves on the
    right comes in on the left."""
    scale = part.shape[1] / columns
    rows = round(crop.height * scale)
    whole = np.zeros((rows, 2 * rows, *part.shape[2:]), part.dtype)
    top = min(round(crop.top * scale), rows - len(part))
    into = (round(crop.left * scale) + np.arange(part.shape[1])) % (2 * rows)
    whole[top : top + len(part), into] = part
    return whole


def _black_caps(rgb: np.ndarray) -> np.ndarray:
    """(h, w) rows at the poles that hold nothing but black, as rigs without zenith or nadir are padded; none where all
    is black."""
    black = rgb.max(axis=(1, 2)) < _BLACK
    if black.all():
        return np.zeros(rgb.shape[:2], bool)
    first, last = np.argmin(black), len(black) - np.argmin(black[::-1])
    rows = np.arange(len(rgb))
    cap = (rows < first) if first >= _CAP * len(rgb) else np.zeros(len(rgb), bool)
    cap |= (rows >= last) if len(rgb) - last >= _CAP * len(rgb) else False
    return np.broadcast_to(cap[:, None], rgb.shape[:2])


def _checked_crop(path: Path, spec: oiio.ImageSpec) -> Crop | None:
    """Where the picture lies in its panorama; None for a whole one. Raises InputError where it is neither."""
    crop = crop_of(spec)
    width, height = (spec.width, spec.height) if crop is None else (crop.width, crop.height)
    if crop is None and not is_sphere(width, height):
        raise InputError(f"{path} is {width}x{height}, not 2:1; {what_shape_is(width, height)}")
    if height < MIN_ROWS:
        raise InputError(f"{path} is {width}x{height}; a panorama needs {MIN_ROWS} rows or more: give a larger one")
    return crop


def _colour_channels(path: Path, names: list[str]) -> list[int]:
    for layer in ("", *(name[:-1] for name in names if name.endswith("COMBINED.R"))):  # Blender's picture among passes
        if {layer + name for name in "RGB"} <= set(names):
            return [names.index(layer + name) for name in "RGB"]
    if names[0] == "Y" and "RY" not in names:
        return [0, 0, 0]
    raise InputError(f"{path} has the channels {', '.join(names)}: save it as grey or with channels R, G and B")


def _alpha_channel(names: list[str]) -> int | None:
    return next((i for i, name in enumerate(names) if name == "A" or name.endswith("COMBINED.A")), None)
