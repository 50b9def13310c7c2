"""Scenes as SPZ (github.com/nianticlabs/spz): quantised columns, about 16 bytes a Gaussian, in spz_streams' container.
Version 3, which every reader knows, is written unless 4 is asked for, which packs tighter; 1 to 4 are read: 1 has
positions in half floats.

positions (24-bit fixed point)  opacity (u8)  colour (u8)  log scales (u8, 1/16)
rotation (1 and 2: u8 x y z; 3 and 4: three of 10 bits and which is left out)  SH (5 and 4 bits)

Axes: the numbers are those of the PLY that ply.py writes, as most readers take them (experiments/README.md, "export",
names them). SPZ's papers say right, up, back, which the axes `y` of up_axis.py are.
"""

import warnings
from pathlib import Path

import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import write_bytes
from rein3d_jax.io.splats.gaussian_columns import REST_COUNTS, Columns, alive_columns, from_columns
from rein3d_jax.io.splats.quantise import alpha_bytes, alpha_logits, with_largest, without_largest
from rein3d_jax.io.splats.spz_streams import MAX_SPZ_GAUSSIANS, SpzHeader, pack_spz, unpack_spz
from rein3d_jax.scene import Gaussians

_FRACTIONAL_BITS = 12  # of the 24: 0.24 mm, and 2 km to either side
_COLOUR_SCALE = 0.15  # 0.5 + 0.15 f_dc fills the byte
_STEPS = 511 / np.sqrt(0.5)  # of a rotation's three smaller components, which are at most sqrt(0.5)


def encode_spz(
    gaussians: Gaussians, name: str | Path = "the scene", *, antialias: bool = False, version: int = 3
) -> bytes:
    """The alive slots as the bytes of an SPZ file; `antialias` sets the flag that write_ply explains. Raises
    InputError, calling the scene `name`, if a value is not finite, if there are over MAX_SPZ_GAUSSIANS, or if it
    reaches beyond 8000 km; for version 4 without zstandard."""
    c = alive_columns(gaussians, name)
    count, bits = len(c.means), _fractional_bits(c.means, name)
    if count > MAX_SPZ_GAUSSIANS:
        raise InputError(f"{name} has {count} Gaussians, more than the {MAX_SPZ_GAUSSIANS} of an SPZ file: write a PLY")
    fixed = np.round(c.means.astype(np.float64) * 2**bits).astype("<i4")
    blocks = [
        fixed[..., None].view(np.uint8)[..., :3],
        alpha_bytes(c.opacity_logits),
        _byte(255 * (0.5 + _COLOUR_SCALE * c.sh[:, 0])),
        _byte(16 * (c.log_scales + 10)),
        _smallest_three(c.quats),
        _rest_bytes(c.sh[:, 1:]),
    ]
    return pack_spz(SpzHeader(version, count, REST_COUNTS.index(c.sh.shape[1] - 1), bits, antialias), blocks)


def write_spz(path: str | Path, gaussians: Gaussians, *, antialias: bool = False, version: int = 3) -> None:
    """Writes the alive slots, atomically. Raises InputError as encode_spz does, and writes nothing."""
    write_bytes(path, encode_spz(gaussians, path, antialias=antialias, version=version))


def read_spz(path: str | Path) -> Gaussians:
    """The scene in an SPZ file of version 1 to 4, every slot alive; degree 4 is left out, with a warning. Raises
    InputError as unpack_spz does."""
    path = Path(path)
    header, (means, alpha, colour, scales, rotation, sh) = unpack_spz(path)
    if header.degree >= len(REST_COUNTS):
        warnings.warn(f"{path} has SH degree {header.degree}, of which degrees 0 to 3 are read", stacklevel=3)
    rest = min(sh.shape[1] // 3, REST_COUNTS[-1])
    dc = ((colour / 255 - 0.5) / _COLOUR_SCALE)[:, None]
    sh = sh[:, : 3 * rest].reshape(header.count, rest, 3) / 128 - 1
    quats = (_quats_from_xyz if header.version < 3 else _quats_from_smallest_three)(rotation)
    log_scales = scales / np.float32(16) - 10
    metres = _halves(means) if header.version == 1 else _fixed(means) / 2.0**header.bits
    fields = (metres, log_scales, quats, alpha_logits(alpha[:, 0]), np.hstack([dc, sh]))
    return from_columns(Columns(*(field.astype(np.float32) for field in fields)), path)


def _fractional_bits(means: np.ndarray, name: str | Path) -> int:
    """As many as leave room for the farthest coordinate, _FRACTIONAL_BITS at most."""
    farthest = float(np.abs(means).max(initial=0))
    bits = next((bits for bits in range(_FRACTIONAL_BITS, -1, -1) if farthest * 2**bits < 2**23 - 1), None)
    if bits is None:
        raise InputError(f"{name} reaches {farthest:.3g} m, beyond an SPZ file's 8000 km: scale it down or write a PLY")
    return bits


def _smallest_three(quats: np.ndarray) -> np.ndarray:
    """wxyz (n, 4) -> (n, 4) bytes: 2 bits say which of x y z w is largest, and is left out, made positive; a sign and 9
    bits for each of the others."""
    others, largest = without_largest(np.roll(quats, -1, axis=1))
    numbers = np.minimum(np.abs(others) * _STEPS + 0.5, 511).astype(np.uint32) | (others < 0).astype(np.uint32) << 9
    word = largest.astype(np.uint32) << 30 | numbers[:, 0] << 20 | numbers[:, 1] << 10 | numbers[:, 2]
    return word.astype("<u4")[:, None].view(np.uint8)


def _byte(values: np.ndarray) -> np.ndarray:
    return np.clip(np.round(values), 0, 255).astype(np.uint8)


def _rest_bytes(rest: np.ndarray) -> np.ndarray:
    """(n, k, 3) -> uint8: 128 + 128 f in steps of 8 for degree 1 and of 16 above, which gzip then packs."""
    step = np.where(np.arange(rest.shape[1]) < 3, 8, 16)[:, None]
    return np.clip(np.round((128 + 128 * rest) / step) * step, 0, 255).astype(np.uint8)


def _halves(means: np.ndarray) -> np.ndarray:
    """(n, 6) bytes -> (n, 3) metres."""
    return np.ascontiguousarray(means).view("<f2").astype(np.float32)


def _fixed(means: np.ndarray) -> np.ndarray:
    """(n, 9) bytes -> (n, 3) signed 24-bit integers."""
    low, middle, high = np.moveaxis(means.reshape(-1, 3, 3).astype(np.int32), -1, 0)
    return ((high << 24) | (middle << 16) | (low << 8)) >> 8  # the shift back repeats the sign


def _quats_from_xyz(rotation: np.ndarray) -> np.ndarray:
    """Versions 1 and 2: x y z as bytes (n, 3); w is what a unit quaternion lacks -> wxyz (n, 4)."""
    xyz = rotation / 127.5 - 1
    w = np.sqrt(np.maximum(0, 1 - (xyz**2).sum(axis=1, keepdims=True)))
    return np.hstack([w, xyz])


def _quats_from_smallest_three(rotation: np.ndarray) -> np.ndarray:
    """Inverse of _smallest_three -> wxyz (n, 4)."""
    word = np.ascontiguousarray(rotation).view("<u4")[:, 0]
    others = np.stack([(word >> shift) & 1023 for shift in (20, 10, 0)], axis=1).astype(np.int32)
    values = np.where(others & 512, -1, 1) * (others & 511) / _STEPS
    return with_largest(values, word >> 30)[:, [3, 0, 1, 2]]
