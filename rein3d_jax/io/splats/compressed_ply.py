"""Scenes as PlayCanvas's compressed PLY (what SuperSplat saves): 16 bytes a Gaussian, in chunks of 256 neighbours.

Element chunk: float32 bounds of position, log scale and colour. Element vertex: four uint32, each value rounded within
its chunk's bounds: position 11-10-11 bits, rotation 2 (which of wxyz is largest) + 3 x 10, log scale 11-10-11, colour
and opacity 8-8-8-8. Element sh: uint8 f_rest, channel-major, in [-4, 4). The axes are the world's, as in scene.ply:
+Z up. The order of the Gaussians changes: neighbours come together, so that bounds are narrow.
"""

from pathlib import Path

import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.geometry.spherical_harmonics import C0, sh_from_rgb
from rein3d_jax.io.files.atomic import write_bytes
from rein3d_jax.io.splats.gaussian_columns import REST_COUNTS, Columns, alive_columns, from_columns
from rein3d_jax.io.splats.ply_table import header_lines
from rein3d_jax.io.splats.quantise import (
    alpha_bytes,
    alpha_logits,
    from_levels,
    to_levels,
    with_largest,
    without_largest,
)
from rein3d_jax.scene import Gaussians

_CHUNK = 256  # Gaussians
_BOUNDS = [f"{end}_{name}" for stem in ("{}", "scale_{}") for end in ("min", "max") for name in map(stem.format, "xyz")]
_COLOUR_BOUNDS = [f"{end}_{channel}" for end in ("min", "max") for channel in "rgb"]
_PACKED = ["packed_position", "packed_rotation", "packed_scale", "packed_color"]
_SCALE_LIMIT = 20.0  # log scales beyond are clipped, as SuperSplat does


def write_compressed_ply(path: str | Path, gaussians: Gaussians) -> None:
    """Writes the alive slots, atomically. Raises InputError, and writes nothing, if a value is not finite."""
    columns = alive_columns(gaussians, path)
    order = morton_order(columns.means)
    means, log_scales, quats, logits, sh = (field[order] for field in columns)
    count = len(means)
    places, place_bounds = _pack_bounded(means, (11, 10, 11))
    scales, scale_bounds = _pack_bounded(np.clip(log_scales, -_SCALE_LIMIT, _SCALE_LIMIT), (11, 10, 11))
    colours, colour_bounds = _pack_bounded(0.5 + C0 * sh[:, 0], (8, 8, 8))
    words = np.stack([places, _pack_quats(quats), scales, colours << 8 | alpha_bytes(logits)], axis=1)
    bounds = np.concatenate([place_bounds, scale_bounds, colour_bounds], axis=1)
    rest = sh[:, 1:].swapaxes(1, 2).reshape(count, 3 * (sh.shape[1] - 1))
    rest = np.clip(np.floor((rest / 8 + 0.5) * 256), 0, 255).astype(np.uint8)
    data = b"".join([bounds.astype("<f4").tobytes(), words.astype("<u4").tobytes(), rest.tobytes()])
    write_bytes(path, _header(len(bounds), count, rest.shape[1]).encode() + data)


def is_compressed_ply(path: str | Path) -> bool:
    """Whether a PLY's header speaks of packed positions. Raises InputError if the file cannot be read."""
    return any(words[-1] == "packed_position" for words in header_lines(Path(path))[0])


def read_compressed_ply(path: str | Path) -> Gaussians:
    """The scene in a compressed PLY, every slot alive. Raises InputError, before allocation, if the header is another
    format's or the file is not as long as it declares; and if a value is not finite."""
    path = Path(path)
    coloured, rest, count, start = _read_layout(path)
    per_chunk = 18 if coloured else 12
    chunks = -(-count // _CHUNK)
    bounds = np.fromfile(path, "<f4", chunks * per_chunk, offset=start).reshape(chunks, per_chunk)
    start += bounds.nbytes
    words = np.fromfile(path, "<u4", 4 * count, offset=start).reshape(count, 4)
    levels = np.fromfile(path, np.uint8, rest * count, offset=start + words.nbytes).reshape(count, 3, rest // 3)
    bounds = bounds if coloured else np.hstack([bounds, np.tile(np.float32([0, 0, 0, 1, 1, 1]), (chunks, 1))])
    means = _unpack_bounded(words[:, 0], bounds[:, :6], (11, 10, 11))
    log_scales = _unpack_bounded(words[:, 2], bounds[:, 6:12], (11, 10, 11))
    rgb = _unpack_bounded(words[:, 3] >> 8, bounds[:, 12:], (8, 8, 8))
    sh = np.concatenate([sh_from_rgb(rgb)[:, None], 8 * ((levels + 0.5) / 256 - 0.5).swapaxes(1, 2)], axis=1)
    logits = alpha_logits(words[:, 3].astype(np.uint8))
    fields = (means, log_scales, _unpack_quats(words[:, 1]), logits, sh)
    return from_columns(Columns(*(field.astype(np.float32) for field in fields)), path)


def morton_order(means: np.ndarray) -> np.ndarray:
    """Indices (n,) along a curve that stays among neighbours: 10 bits of x, y and z, interleaved."""
    means = means.astype(np.float64)
    low, high = means.min(axis=0, initial=np.inf), means.max(axis=0, initial=-np.inf)
    cells = to_levels((means - low) / np.maximum(high - low, 1e-30), 10).astype(np.int64)
    bits = np.arange(10)
    return np.argsort(((cells[..., None] >> bits & 1) << (3 * bits + np.arange(3)[:, None])).sum((1, 2)), kind="stable")


def _header(chunks: int, count: int, rest: int) -> str:
    elements = [("chunk", chunks, "float", _BOUNDS + _COLOUR_BOUNDS), ("vertex", count, "uint", _PACKED)]
    elements += [("sh", count, "uchar", [f"f_rest_{i}" for i in range(rest)])] * bool(rest)
    lines = ["ply", "format binary_little_endian 1.0"]
    for name, size, kind, properties in elements:
        lines += [f"element {name} {size}", *(f"property {kind} {each}" for each in properties)]
    return "\n".join([*lines, "end_header", ""])


def _read_layout(path: Path) -> tuple[bool, int, int, int]:
    """Whether chunks bound colours, f_rest properties, count, and where the data starts, checked against the size."""
    lines, start = header_lines(path)
    text, size = "\n".join(map(" ".join, lines)), path.stat().st_size
    found = [int(words[-1]) for words in lines if _is_count(words)]
    chunks, count = (*found, 0, 0)[:2]
    for coloured in (True, False):
        for rest in REST_COUNTS:
            if text + "\nend_header\n" != _known_header(chunks, count, 3 * rest, coloured):
                continue
            needed = start + 4 * chunks * (18 if coloured else 12) + count * (16 + 3 * rest)
            if chunks != -(-count // _CHUNK) or needed > size:
                raise InputError(f"{path} declares {count} Gaussians in {chunks} chunks, {needed} bytes, but has {size}"
                                 ": it is damaged, copy or export it again")  # fmt: skip
            return coloured, 3 * rest, count, start
    raise InputError(f"{path} has no compressed PLY's header: export it as compressed PLY or as a 3DGS PLY")


def _is_count(words: list[str]) -> bool:
    return len(words) == 3 and words[0] == "element" and words[2].isdecimal() and len(words[2]) < 16


def _known_header(chunks: int, count: int, rest: int, coloured: bool) -> str:
    text = _header(chunks, count, rest)
    return text if coloured else text.replace("".join(f"property float {name}\n" for name in _COLOUR_BOUNDS), "")


def _pack_bounded(values: np.ndarray, bits: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) -> uint32 (n,) and each chunk's bounds (chunks, 6), minima first."""
    starts = np.arange(0, len(values), _CHUNK)
    if not len(starts):
        return np.zeros(0, np.uint32), np.zeros((0, 6), np.float32)
    bounds = np.hstack([np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)]).astype(np.float32)
    low, high = _each(bounds, len(values))
    unit = (values - low) / np.where(high > low, high - low, 1)
    return _join([to_levels(unit[:, i], bits[i]) for i in range(3)], bits), bounds


def _unpack_bounded(words: np.ndarray, bounds: np.ndarray, bits: tuple[int, int, int]) -> np.ndarray:
    low, high = _each(bounds, len(words))
    shifts = (bits[1] + bits[2], bits[2], 0)
    unit = np.stack([from_levels(words >> shift, width) for shift, width in zip(shifts, bits, strict=True)], axis=1)
    with np.errstate(invalid="ignore", over="ignore"):  # wild bounds are refused by what comes out
        return low * (1 - unit) + high * unit


def _each(bounds: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Chunk bounds (chunks, 6) -> low and high (n, 3) of every Gaussian."""
    low, high = np.split(bounds.astype(np.float64).repeat(_CHUNK, axis=0)[:count], 2, axis=1)
    return low, high


def _join(levels: list[np.ndarray], bits: tuple[int, ...]) -> np.ndarray:
    """The first in the highest bits."""
    word = np.zeros_like(levels[0])
    for level, width in zip(levels, bits, strict=True):
        word = word << width | level
    return word


def _pack_quats(quats: np.ndarray) -> np.ndarray:
    """wxyz (n, 4) -> uint32 (n,): the largest one's place, and the three others in [-1, 1] / sqrt(2)."""
    others, largest = without_largest(quats)
    levels = to_levels(others * np.sqrt(0.5) + 0.5, 10)
    return _join([largest.astype(np.uint32), *levels.T], (2, 10, 10, 10))


def _unpack_quats(words: np.ndarray) -> np.ndarray:
    others = np.stack([from_levels(words >> shift, 10) - 0.5 for shift in (20, 10, 0)], axis=1) * np.sqrt(2)
    return with_largest(others, words >> 30)
