"""Distance maps: metres along the ray, (h, w), with the mask of what is known. Planar z never passes for it."""

import re
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.npy import read_arrays, read_headers
from rein3d_jax.io.pictures.decode import MAX_COLUMNS, open_image, read_pixels
from rein3d_jax.io.pictures.exr import write_exr

_MILLIMETRE = 0.001  # whole numbers hold millimetres
_NOWHERE = 1e9  # of any unit: Blender writes 1e10
_MANY, _SUSPICIOUS = 200, 0.01  # values of a map; share of its pixels that hold the largest one exactly
_FARTHEST_MEDIAN = 1000.0  # metres; no room is like that, but any room is in millimetres
_PLANAR = re.compile(r"(?<![a-z])z(?![a-z])|planar|zdepth|depthz|zbuf")
_BEST_FIRST = ("distance", "depth", "y", "r")
_MAPS = "give a float EXR, TIFF or PFM, a 16-bit grey PNG in mm, an NPY or an NPZ"


def read_distance(
    path: str | Path, shape: tuple[int, int] | None = None, *, metres: bool = True, unit: float | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Distance (h, w) float32 metres along the ray, 0 where unknown, and valid (h, w) bool; without `metres`, numbers
    that mean something else (depth/kinds.py), as they stand in the file.

    EXR (one channel, or one named distance, depth, Y or R), float TIFF and PFM, 16-bit PNG or TIFF, NPY, or NPZ (one
    array, or the key "distance" or "depth"); axes of length 1 do not count. `unit` is the numbers' in metres; None:
    metres, and millimetres where they are whole. 0, negative, NaN, inf, what is beyond any room, and the largest
    number, where suspiciously many pixels hold exactly that, mean unknown. Raises InputError, before pixels are
    allocated where the header tells: missing, damaged, another size than `shape` (h, w) or than 2:1, 8 bits, nothing
    known; of `metres` a name that says planar z, or a median that looks like millimetres.
    """
    path = Path(path)
    read = _read_numpy if path.suffix.lower() in (".npy", ".npz") else _read_image
    numbers = read(path, shape, metres)
    unknown = _beyond(numbers)
    scale = unit or (_MILLIMETRE if numbers.dtype.kind in "ui" and metres else 1.0)
    with np.errstate(over="ignore"):  # float64 beyond float32 becomes inf: unknown
        distance = (numbers * scale).astype(np.float32)
    valid = np.isfinite(distance) & (distance > 0) & ~unknown
    _check_known(path, distance[valid], metres)
    return np.where(valid, distance, np.float32(0)), valid


def _beyond(numbers: np.ndarray) -> np.ndarray:
    """Where numbers stand for "nothing there": what only a code or a far clip can be."""
    whole = numbers.dtype.kind in "ui"
    beyond = numbers == np.iinfo(numbers.dtype).max if whole else numbers.astype(np.float64) > _NOWHERE
    known = numbers[np.isfinite(numbers) & ~beyond & (numbers > 0)]
    if not known.size or np.count_nonzero(known == known.max()) <= _SUSPICIOUS * known.size:
        return beyond  # as nearly every map: to count all of a large one's values takes seconds
    values, counts = np.unique(known, return_counts=True)
    # A map has thousands of values, and its farthest stands in a corner: of a clipped one it stands everywhere.
    if values.size > _MANY and counts[-1] > 10 * np.median(counts):
        beyond |= numbers == values[-1]
    return beyond


def write_distance_exr(path: str | Path, distance: np.ndarray) -> None:
    """Writes distance (h, w) metres, 0 where unknown, to a float32 EXR file with the channel Y, atomically.
    The same distance gives the same bytes. Raises InputError."""
    write_exr(path, {"Y": distance})


def _check_known(path: Path, known: np.ndarray, metres: bool) -> None:
    if not known.size:
        mend = "give metres along the ray"
        raise InputError(f"{path} holds no distance: every pixel is 0, negative, NaN or inf; {mend}")
    if metres and (median := np.median(known)) > _FARTHEST_MEDIAN:
        raise InputError(f"{path} has a median of {median:.0f}: it looks like millimetres; divide it by 1000")


def _check_size(path: Path, found: tuple[int, ...], shape: tuple[int, int] | None) -> None:
    if shape is None:
        if len(found) != 2 or found[1] != 2 * found[0] or found[1] > MAX_COLUMNS:
            has = " x ".join(map(str, found))
            mend = f"give twice as many columns as rows, {MAX_COLUMNS} at most, as its panorama has"
            raise InputError(f"{path} has {has} values (rows x columns): {mend}")
    elif found != tuple(shape):
        has, needs = (" x ".join(map(str, size)) for size in (found, shape))
        raise InputError(f"{path} has {has} values (rows x columns), its panorama {needs}: resize one to the other")


def _check_name(path: Path, name: str, metres: bool) -> None:
    # A panoramic camera's Depth.Z in Blender is along the ray; whether it is shows in its surfaces (given_distance).
    if metres and not name.endswith("Depth.Z") and _PLANAR.search(name.lower()):
        mend = "set input.distance_kind = z if it is that of cube faces; if it is along the ray, name it distance"
        raise InputError(f"{path} holds {name!r}, which says planar z, not distance: {mend}")


def _read_numpy(path: Path, shape: tuple[int, int] | None, metres: bool) -> np.ndarray:
    headers = read_headers(path)
    name = next((name for name in ("distance", "depth") if name in headers), next(iter(headers), ""))
    if len(headers) != 1 and name not in ("distance", "depth"):
        raise InputError(f"{path} holds the arrays {', '.join(headers) or '(none)'}: name the one to use distance")
    _check_name(path, name, metres)
    found = tuple(size for size in headers[name].shape if size != 1)
    _check_size(path, found, shape)
    if headers[name].dtype.kind not in "fui" or headers[name].dtype.itemsize == 1:
        raise InputError(f"{path} holds {headers[name].dtype} values: save the distance as float metres")
    return read_arrays(path, [name])[0].reshape(found)


def _read_image(path: Path, shape: tuple[int, int] | None, metres: bool) -> np.ndarray:
    with open_image(path) as image:
        spec = image.spec()
        _check_size(path, (spec.height, spec.width), shape)
        kind = image.format_name()
        if kind in ("png", "tiff") and spec.format == oiio.UINT16 and spec.nchannels in (1, 3):
            pixels = read_pixels(path, image, "uint16")
            if not (pixels == pixels[..., :1]).all():
                raise InputError(f"{path} is a colour picture: give distance in one channel")
            return pixels[..., 0]
        if kind not in ("openexr", "tiff", "pnm") or spec.format not in (oiio.HALF, oiio.FLOAT):
            raise InputError(f"{path} is no distance map: {_MAPS}")
        channel = _distance_channel(path, spec.channelnames, metres)
        pixels = read_pixels(path, image, "float")
    distance = pixels[..., spec.channelnames.index(channel)]
    beside = {channel[:-1] + letter for letter in "GBgb"} if channel[-1] in "Rr" else ()
    colours = [pixels[..., i] for i, name in enumerate(spec.channelnames) if name in beside]
    if not all(np.array_equal(distance, colour, equal_nan=True) for colour in colours):
        raise InputError(f"{path} is a colour picture: give distance in one channel, named Y")
    return distance


def _distance_channel(path: Path, names: tuple[str, ...], metres: bool) -> str:
    by_leaf = {name.rpartition(".")[2].lower(): name for name in reversed(names)}
    known = [by_leaf[leaf] for leaf in _BEST_FIRST if leaf in by_leaf]
    if not known and len(names) != 1:
        for name in names:
            _check_name(path, name, metres)
        raise InputError(f"{path} has the channels {', '.join(names)}: name the distance Y")
    chosen = (known or names)[0]
    _check_name(path, chosen, metres)
    return chosen
