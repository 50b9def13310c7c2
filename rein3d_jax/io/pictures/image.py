"""Panoramas as pictures: read, resized, encoded, written. sRGB in [0, 1], (h, w, 3)."""

from pathlib import Path

import cv2
import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import write_bytes
from rein3d_jax.io.pictures.decode import open_image, read_pixels
from rein3d_jax.io.pictures.tone import tone_map

MIN_ROWS = 16
_LINEAR = ("openexr", "hdr")  # formats that hold linear light


def read_rgb(path: str | Path, *, panorama: bool = True) -> np.ndarray:
    """Equirectangular picture as float32 sRGB (h, 2 h, 3) in [0, 1]; with `panorama` False, one of any aspect.

    JPEG and PNG (8 or 16 bits, grey spread to three channels, alpha dropped) are taken as sRGB; EXR and HDR as
    linear light, which is exposed and tone-mapped (tone.py). Raises InputError, before pixels are allocated
    where the header tells: missing, no picture, damaged, not 2:1, under MIN_ROWS rows, over MAX_COLUMNS columns.
    """
    path = Path(path)
    with open_image(path) as image:
        spec = image.spec()
        if panorama:
            _check_panorama(path, spec.width, spec.height)
        channels = _colour_channels(path, [name.upper() for name in spec.channelnames])
        pixels = read_pixels(path, image, "float")[..., channels]
        return tone_map(pixels) if image.format_name() in _LINEAR else pixels


def panorama_rows(path: str | Path) -> int:
    """The rows of the equirectangular picture in a file, by its header. Raises InputError as `read_rgb` does."""
    with open_image(Path(path)) as image:
        spec = image.spec()
        _check_panorama(Path(path), spec.width, spec.height)
        return spec.height


def resize_panorama(
    rgb: np.ndarray, distance: np.ndarray | None, valid: np.ndarray | None, height: int
) -> tuple[np.ndarray, np.ndarray | None, np.ndarray | None]:
    """Picture (h, 2h, 3), distance (k, 2k) and its mask (k, 2k) at `height` rows; None stays None.

    Colour is averaged over each new pixel's area (bilinear, round the seam and over the poles, when the picture
    grows). Distance and validity are picked at the nearest sample: two surfaces never mix.
    """
    assert rgb.shape[1] == 2 * rgb.shape[0], rgb.shape
    return _resize_colour(rgb, height), *(None if x is None else _picked(x, height) for x in (distance, valid))


def _picked(values: np.ndarray, height: int) -> np.ndarray:
    if height == len(values):
        return values
    return values[np.ix_(_nearest(len(values), height), _nearest(2 * len(values), 2 * height))]


def _resize_colour(rgb: np.ndarray, height: int) -> np.ndarray:
    if height == len(rgb):
        return rgb
    if height < len(rgb):  # areas of a 2:1 grid never reach across the seam
        return cv2.resize(rgb, (2 * height, height), interpolation=cv2.INTER_AREA)
    return _enlarge(rgb, height)


def to_uint8(rgb: np.ndarray) -> np.ndarray:
    """Bytes of sRGB in [0, 1] of any shape, rounded; values outside are clipped."""
    rgb = np.asarray(rgb)
    assert np.isfinite(rgb).all(), "a picture must be finite"
    return (np.clip(rgb, 0, 1) * 255 + 0.5).astype(np.uint8)


def encode_jpeg(rgb: np.ndarray, quality: int = 92) -> bytes:
    """JPEG file of sRGB (h, w, 3) in [0, 1]."""
    return _encode(".jpg", rgb, [cv2.IMWRITE_JPEG_QUALITY, quality])


def encode_png(rgb: np.ndarray) -> bytes:
    """8-bit PNG file of sRGB (h, w, 3) in [0, 1]."""
    return _encode(".png", rgb, [])


def write_rgb(path: str | Path, rgb: np.ndarray) -> None:
    """Writes sRGB (h, w, 3) in [0, 1] to a PNG or JPEG file, by suffix, atomically. Raises InputError."""
    encoders = {".png": encode_png, ".jpg": encode_jpeg, ".jpeg": encode_jpeg}
    encode = encoders.get(Path(path).suffix.lower())
    if encode is None:
        raise InputError(f"{path} has no picture format known by its suffix: end it in .png or .jpg")
    write_bytes(path, encode(rgb))


def _check_panorama(path: Path, width: int, height: int) -> None:
    if width != 2 * height:
        mend = "a panorama must be twice as wide as high: crop or pad it to 2:1"
        raise InputError(f"{path} is {width}x{height}; {mend}")
    if height < MIN_ROWS:
        raise InputError(f"{path} is {width}x{height}; a panorama needs {MIN_ROWS} rows or more: give a larger one")


def _colour_channels(path: Path, names: list[str]) -> list[int]:
    if {"R", "G", "B"} <= set(names):
        return [names.index(name) for name in "RGB"]
    if names[0] == "Y" and "RY" not in names:
        return [0, 0, 0]
    raise InputError(f"{path} has the channels {', '.join(names)}: save it as grey or with channels R, G and B")


def _encode(suffix: str, rgb: np.ndarray, options: list[int]) -> bytes:
    assert rgb.ndim == 3 and rgb.shape[-1] == 3, rgb.shape
    _, data = cv2.imencode(suffix, to_uint8(rgb)[..., ::-1], options)
    return data.tobytes()


def _nearest(size: int, new_size: int) -> np.ndarray:
    """(new_size,) index of the old pixel that holds each new pixel's centre."""
    return (2 * np.arange(new_size) + 1) * size // (2 * new_size)


def _enlarge(rgb: np.ndarray, height: int) -> np.ndarray:
    """Bilinear. One row is padded over each pole (it continues 180 degrees away) and one column round the seam."""
    over_pole = np.roll(rgb[[0, -1]], len(rgb), axis=1)
    padded = np.concatenate([over_pole[:1], rgb, over_pole[1:]])
    padded = np.concatenate([padded[:, -1:], padded, padded[:, :1]], axis=1)
    return _interpolate(_interpolate(padded, height, 0), 2 * height, 1)


def _interpolate(padded: np.ndarray, size: int, axis: int) -> np.ndarray:
    """Resamples one axis, which has one pixel of padding at both ends, to `size` pixels."""
    x = (np.arange(size) + 0.5) * (padded.shape[axis] - 2) / size + 0.5
    low = x.astype(int)
    share = (x - low).astype(padded.dtype).reshape((-1,) + (1,) * (padded.ndim - 1 - axis))
    return padded.take(low, axis) * (1 - share) + padded.take(low + 1, axis) * share
