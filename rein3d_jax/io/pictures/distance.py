"""Distance maps: metres along the ray, (h, w), with the mask of what is known. Planar z never passes for it."""

import re
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.npy import read_arrays, read_headers
from rein3d_jax.io.pictures.decode import MAX_COLUMNS, open_image, read_pixels
from rein3d_jax.io.pictures.exr import write_exr

_METRES_PER_UNIT = 0.001  # 16-bit PNG holds millimetres
_FARTHEST_MEDIAN = 1000.0  # metres; no room is like that, but any room is in millimetres
_PLANAR = re.compile(r"(?<![a-z])z(?![a-z])|planar|zdepth|depthz|zbuf")
_BEST_FIRST = ("distance", "depth", "y", "r")


def read_distance(
    path: str | Path, shape: tuple[int, int] | None = None, *, metres: bool = True
) -> tuple[np.ndarray, np.ndarray]:
    """Distance (h, w) float32 metres along the ray, 0 where unknown, and valid (h, w) bool; without `metres`, numbers
    that mean something else (depth/kinds.py), as they stand in the file.

    EXR (one channel, or one named distance, depth, Y or R), 16-bit PNG (millimetres), NPY, or NPZ (one array, or
    the key "distance"). 0, negative, NaN and inf mean unknown. Raises InputError, before pixels are allocated
    where the header tells: missing, damaged, another size than `shape` (h, w) or than 2:1, 8 bits, nothing known; of
    `metres` a name that says planar z, or a median that looks like millimetres.
    """
    path = Path(path)
    read = _read_numpy if path.suffix.lower() in (".npy", ".npz") else _read_image
    with np.errstate(over="ignore"):  # float64 beyond float32 becomes inf: unknown
        distance = read(path, shape, metres).astype(np.float32)
    valid = np.isfinite(distance) & (distance > 0)
    _check_known(path, distance[valid], metres)
    return np.where(valid, distance, np.float32(0)), valid


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
    if metres and _PLANAR.search(name.lower()):
        mend = "set input.distance_kind = z if it is that of cube faces; if it is along the ray, name it distance"
        raise InputError(f"{path} holds {name!r}, which says planar z, not distance: {mend}")


def _read_numpy(path: Path, shape: tuple[int, int] | None, metres: bool) -> np.ndarray:
    headers = read_headers(path)
    name = "distance" if "distance" in headers else next(iter(headers), "")
    if len(headers) != 1 and name != "distance":
        raise InputError(f"{path} holds the arrays {', '.join(headers) or '(none)'}: name the one to use distance")
    _check_name(path, name, metres)
    _check_size(path, headers[name].shape, shape)
    if headers[name].dtype.kind != "f":
        raise InputError(f"{path} holds {headers[name].dtype} values: save the distance as float metres")
    return read_arrays(path, [name])[0]


def _read_image(path: Path, shape: tuple[int, int] | None, metres: bool) -> np.ndarray:
    with open_image(path) as image:
        spec = image.spec()
        _check_size(path, (spec.height, spec.width), shape)
        if image.format_name() == "png" and spec.format == oiio.UINT16 and spec.nchannels == 1:
            return read_pixels(path, image, "uint16")[..., 0] * _METRES_PER_UNIT
        if image.format_name() != "openexr" or spec.format not in (oiio.HALF, oiio.FLOAT):
            raise InputError(f"{path} is no distance map: give a float EXR, a 16-bit grey PNG in mm, an NPY or an NPZ")
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
