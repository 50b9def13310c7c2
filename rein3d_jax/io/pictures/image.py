"""Pictures as sRGB in [0, 1], (h, w, 3): resized, encoded, written."""

from pathlib import Path

import cv2
import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import write_bytes


def resize_panorama(
    rgb: np.ndarray, distance: np.ndarray | None, valid: np.ndarray | None, height: int
) -> tuple[np.ndarray, np.ndarray | None, np.ndarray | None]:
    """Picture (h, 2h, 3), distance (k, 2k) and its mask (k, 2k) at `height` rows; None stays None.

    Colour is averaged over each new pixel's area (bilinear, round the seam and over the poles, when the picture
    grows). Distance and validity are picked at the nearest sample: two surfaces never mix.
    """
    assert rgb.shape[1] == 2 * rgb.shape[0], rgb.shape
    return resize_colour(rgb, height), *(None if x is None else picked(x, height) for x in (distance, valid))


def picked(values: np.ndarray, height: int) -> np.ndarray:
    """Values (h, 2 h) at `height` rows, each the nearest sample."""
    if height == len(values):
        return values
    return values[np.ix_(_nearest(len(values), height), _nearest(2 * len(values), 2 * height))]


def resize_colour(rgb: np.ndarray, height: int) -> np.ndarray:
    """Picture (h, 2 h, c) at `height` rows, as `resize_panorama` says."""
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
