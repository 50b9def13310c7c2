"""Scenes as SPZ (github.com/nianticlabs/spz): a gzip stream of a 16-byte header and quantised columns, about 16 bytes
a Gaussian. Version 2 is written, 1 to 3 are read: 1 has positions in half floats. Version 4 is of zstd streams.

positions (24-bit fixed point)  opacity (u8)  colour (u8)  log scales (u8, 1/16)  rotation (u8 xyz)  SH (5 and 4 bits)

A rotation may come back 180 degrees about one of the splat's own axes off, which is the same splat.
Axes: SPZ says that it holds right, up, back, and every converter makes it of a PLY (right, down, front) by flipping
y and z. So does this file: converted to PLY by others, it is the scene.ply that ply.py writes, +Z up.
"""

import gzip
import struct
import zlib
from pathlib import Path

import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import write_bytes
from rein3d_jax.io.files.input_file import require_file
from rein3d_jax.io.splats.gaussian_columns import REST_COUNTS, Columns, alive_columns, from_columns
from rein3d_jax.io.splats.quantise import alpha_bytes, alpha_logits, with_largest
from rein3d_jax.scene import Gaussians

_MAX_GAUSSIANS = 10_000_000  # the reference library reads no more
_HEADER = struct.Struct("<4sIIBBBB")  # magic, version, count, SH degree, fractional bits, flags, reserved
_FRACTIONAL_BITS = 12  # of the 24: 0.24 mm, and 2 km to either side
_COLOUR_SCALE = 0.15  # 0.5 + 0.15 f_dc fills the byte
_POSITION_BYTES = {1: 6, 2: 9, 3: 9}
_ROTATION_BYTES = {1: 3, 2: 3, 3: 4}
_DEFLATE_RATIO = 1032  # a deflate stream holds no more bytes for each of its own
_FLIP = np.array([1, -1, -1], np.float32)  # y and z
# The sign of each SH basis function above degree 0 when y and z change theirs.
_FLIP_REST = np.array([-1, -1, 1, -1, 1, 1, -1, 1, -1, 1, -1, -1, 1, -1, 1], np.float32)[:, None]


def encode_spz(gaussians: Gaussians, name: str | Path = "the scene", *, antialias: bool = False) -> bytes:
    """The alive slots as the bytes of an SPZ file; `antialias` sets the flag that write_ply explains. Raises
    InputError, calling the scene `name`, if a value is not finite, if there are over _MAX_GAUSSIANS, or if it reaches
    beyond 8000 km."""
    c = alive_columns(gaussians, name)
    count, bits = len(c.means), _fractional_bits(c.means, name)
    if count > _MAX_GAUSSIANS:
        raise InputError(f"{name} has {count} Gaussians, more than the {_MAX_GAUSSIANS} of an SPZ file: write a PLY")
    fixed = np.round(c.means.astype(np.float64) * _FLIP * 2**bits).astype("<i4")
    parts = [
        fixed[..., None].view(np.uint8)[..., :3],
        alpha_bytes(c.opacity_logits),
        _byte(255 * (0.5 + _COLOUR_SCALE * c.sh[:, 0])),
        _byte(16 * (c.log_scales + 10)),
        _byte(127.5 + 127.5 * _turned(c.quats)[:, 1:] * _FLIP),
        _rest_bytes(c.sh[:, 1:] * _FLIP_REST[: c.sh.shape[1] - 1]),
    ]
    header = _HEADER.pack(b"NGSP", 2, count, REST_COUNTS.index(c.sh.shape[1] - 1), bits, antialias, 0)
    return gzip.compress(header + b"".join(part.tobytes() for part in parts), mtime=0)


def write_spz(path: str | Path, gaussians: Gaussians, *, antialias: bool = False) -> None:
    """Writes the alive slots, atomically. Raises InputError as encode_spz does, and writes nothing."""
    write_bytes(path, encode_spz(gaussians, path, antialias=antialias))


def read_spz(path: str | Path) -> Gaussians:
    """The scene in an SPZ file of version 1 to 3, every slot alive. Raises InputError if it is missing, damaged, of
    another version, over _MAX_GAUSSIANS, or not exactly as long as it declares, before more than that is unpacked."""
    path = Path(path)
    require_file(path)
    version, count, degree, bits, data = _unpack(path)
    rest = REST_COUNTS[degree]
    widths = [_POSITION_BYTES[version], 1, 3, 3, _ROTATION_BYTES[version], 3 * rest]
    ends = np.cumsum([count * width for width in widths])[:-1]
    blocks = np.split(np.frombuffer(data, np.uint8), ends)
    means, alpha, colour, scales, rotation, sh = (b.reshape(count, w) for b, w in zip(blocks, widths, strict=True))
    dc = ((colour / 255 - 0.5) / _COLOUR_SCALE)[:, None]
    sh = (sh.reshape(count, rest, 3) / 128 - 1) * _FLIP_REST[:rest]
    quats = (_quats_from_smallest_three if version == 3 else _quats_from_xyz)(rotation) * [1, *_FLIP]
    log_scales = scales / np.float32(16) - 10
    metres = _halves(means) if version == 1 else _fixed(means) / 2.0**bits
    fields = (metres * _FLIP, log_scales, quats, alpha_logits(alpha[:, 0]), np.hstack([dc, sh]))
    return from_columns(Columns(*(field.astype(np.float32) for field in fields)), path)


def _fractional_bits(means: np.ndarray, name: str | Path) -> int:
    """As many as leave room for the farthest coordinate, _FRACTIONAL_BITS at most."""
    farthest = float(np.abs(means).max(initial=0))
    bits = next((bits for bits in range(_FRACTIONAL_BITS, -1, -1) if farthest * 2**bits < 2**23 - 1), None)
    if bits is None:
        raise InputError(f"{name} reaches {farthest:.3g} m, beyond an SPZ file's 8000 km: scale it down or write a PLY")
    return bits


def _turned(quats: np.ndarray) -> np.ndarray:
    """Turned half round one of its own axes a splat stays as it is: of these four wxyz the one with the largest w, made
    positive. The file lacks w, and rebuilt from x y z a small one would be lost."""
    w, x, y, z = quats.T
    same = np.stack([(w, x, y, z), (-x, w, z, -y), (-y, -z, w, x), (-z, y, -x, w)])  # q, q i, q j, q k
    best = np.take_along_axis(same, np.abs(same[:, :1]).argmax(axis=0, keepdims=True), axis=0)[0]
    return (best * np.where(best[:1] < 0, -1, 1)).T


def _byte(values: np.ndarray) -> np.ndarray:
    return np.clip(np.round(values), 0, 255).astype(np.uint8)


def _rest_bytes(rest: np.ndarray) -> np.ndarray:
    """(n, k, 3) -> uint8: 128 + 128 f in steps of 8 for degree 1 and of 16 above, which gzip then packs."""
    step = np.where(np.arange(rest.shape[1]) < 3, 8, 16)[:, None]
    return np.clip(np.round((128 + 128 * rest) / step) * step, 0, 255).astype(np.uint8)


def _unpack(path: Path) -> tuple[int, int, int, int, bytes]:
    """Version, count, degree, fractional bits and the columns' bytes. Every size is checked before it is unpacked."""
    packed = path.read_bytes()
    if packed[:4] == b"NGSP" and len(packed) > _HEADER.size:
        raise _bare(path, int.from_bytes(packed[4:8], "little"))
    stream = zlib.decompressobj(wbits=31)  # one gzip member
    try:
        header = stream.decompress(packed, _HEADER.size)
        version, count, degree, bits, size = _layout(path, header, len(packed))
        data = stream.decompress(stream.unconsumed_tail, size + 1) + stream.decompress(stream.unconsumed_tail, 1)
    except zlib.error as error:
        raise InputError(f"{path} is damaged or no SPZ file ({error}): copy or export it again") from error
    if len(data) != size or not stream.eof:
        found = "more" if len(data) > size else "less"
        raise InputError(f"{path} declares {count} Gaussians and holds {found}: it is damaged, copy or export it again")
    return version, count, degree, bits, data


def _layout(path: Path, header: bytes, packed: int) -> tuple[int, int, int, int, int]:
    if len(header) < _HEADER.size or header[:4] != b"NGSP":
        raise InputError(f"{path} does not begin like an SPZ file: copy or export it again")
    _, version, count, degree, bits, _, _ = _HEADER.unpack(header)
    if version not in _ROTATION_BYTES:
        raise _other_version(path, version)
    if degree >= len(REST_COUNTS) or bits > 23:
        raise InputError(f"{path} declares SH degree {degree} and {bits} fractional bits: export it with degree 0 to 3")
    size = count * (7 + _POSITION_BYTES[version] + _ROTATION_BYTES[version] + 3 * REST_COUNTS[degree])
    if count > _MAX_GAUSSIANS or size > _DEFLATE_RATIO * packed:
        raise InputError(f"{path} declares {count} Gaussians in {packed} bytes: it is damaged, copy or export it again")
    return version, count, degree, bits, size


def _other_version(path: Path, version: int) -> InputError:
    mend = "export it as version 2 or 3, or convert it to .ply with `npx @playcanvas/splat-transform`"
    return InputError(f"{path} is SPZ version {version}, of which 1 to 3 are read: {mend}")


def _bare(path: Path, version: int) -> InputError:
    """A header that is not compressed, as since version 4."""
    if version not in _ROTATION_BYTES:
        return _other_version(path, version)
    return InputError(f"{path} is SPZ version {version}, unpacked: pack it with gzip, under the same name")


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
    """Version 3: 2 bits say which of x y z w is largest, the others follow with 1 + 9 bits each -> wxyz (n, 4)."""
    word = np.ascontiguousarray(rotation).view("<u4")[:, 0]
    others = np.stack([(word >> shift) & 1023 for shift in (20, 10, 0)], axis=1).astype(np.int32)
    values = np.where(others & 512, -1, 1) * (others & 511) * (np.sqrt(0.5) / 511)
    return with_largest(values, word >> 30)[:, [3, 0, 1, 2]]
