"""The container of SPZ files (github.com/nianticlabs/spz): a header and the columns' bytes, one block an attribute.

Versions 1 to 3 are one gzip stream of a 16-byte header and the blocks. Version 4 has a plain header of 32 bytes, a
table of contents (compressed and unpacked size of each block that is not empty), and a zstd stream a block. Extension
records (u32 type, u32 length, payload) stand behind the blocks, in version 4 behind the header; all but the one of
another coordinate system change nothing that is read here.
"""

import gzip
import struct
import zlib
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.input_file import require_file
from rein3d_jax.io.splats.gaussian_columns import REST_COUNTS

MAX_SPZ_GAUSSIANS = 10_000_000  # the reference library's loaders before version 4 read no more
SPZ_VERSIONS = (3, 4)  # that are written
_GZIPPED = struct.Struct("<4sIIBBBB")  # magic, version, count, SH degree, fractional bits, flags, reserved
_PLAIN = struct.Struct("<4sIIBBBBI12x")  # the same, but how many streams last, and where their table begins
_SIZES = struct.Struct("<QQ")  # of a stream, and of its block
_POSITION_BYTES = {1: 6, 2: 9, 3: 9, 4: 9}
_ROTATION_BYTES = {1: 3, 2: 3, 3: 4, 4: 4}
_REST_COUNTS = (*REST_COUNTS, 24)
_ANTIALIASED, _EXTENDED = 1, 2  # flags
_MAX_EXTENSIONS = 1 << 16  # bytes
_COORDINATES = 0xADBE0003  # the extension SPZ_ADOBE_coordinate_system: what axes the numbers are in
_TAKEN_AS_THEY_ARE = (0, 4, 6)  # unspecified; right, up, back; right, down, front
_DEFLATE_RATIO = 1032  # a deflate stream holds no more bytes for each of its own
_ZSTD_RATIO = 10 * 1024  # the reference's loader has 1024 for a Gaussian's position, a tenth of the most that it takes
_MEND = "convert it to .ply with `npx @playcanvas/splat-transform`"


class SpzHeader(NamedTuple):
    """What an SPZ file says of its columns."""

    version: int
    count: int  # Gaussians
    degree: int  # of the spherical harmonics, 0 to 4
    bits: int  # of a fixed-point position behind the point
    antialiased: bool

    @property
    def widths(self) -> list[int]:
        """Bytes a Gaussian of position, opacity, colour, log scales, rotation, higher spherical harmonics."""
        return [_POSITION_BYTES[self.version], 1, 3, 3, _ROTATION_BYTES[self.version], 3 * _REST_COUNTS[self.degree]]


def pack_spz(header: SpzHeader, blocks: list[np.ndarray]) -> bytes:
    """The file of `blocks` (count, width) uint8. Raises InputError for version 4 without zstandard."""
    parts = [block.tobytes() for block in blocks]
    numbers = (b"NGSP", header.version, header.count, header.degree, header.bits, int(header.antialiased))
    if header.version < 4:
        return gzip.compress(_GZIPPED.pack(*numbers, 0) + b"".join(parts), mtime=0)
    parts = [part for part in parts if part]
    streams = [_zstandard().ZstdCompressor(level=12).compress(part) for part in parts]
    sizes = b"".join(_SIZES.pack(len(stream), len(part)) for stream, part in zip(streams, parts, strict=True))
    return _PLAIN.pack(*numbers, len(streams), _PLAIN.size) + sizes + b"".join(streams)


def unpack_spz(path: Path) -> tuple[SpzHeader, list[np.ndarray]]:
    """The header and the blocks (count, width) uint8. Raises InputError, before more than the file declares is
    unpacked, if it is missing, damaged, of another version or in other axes; for version 4 without zstandard."""
    require_file(path)
    packed = path.read_bytes()
    header, data = (_unpack_plain if packed[:4] == b"NGSP" else _unpack_gzip)(path, packed)
    ends = np.cumsum([header.count * width for width in header.widths])[:-1]
    blocks = np.split(np.frombuffer(data, np.uint8), ends)
    return header, [block.reshape(header.count, width) for block, width in zip(blocks, header.widths, strict=True)]


def _unpack_gzip(path: Path, packed: bytes) -> tuple[SpzHeader, bytes]:
    stream = zlib.decompressobj(wbits=31)  # one gzip member
    try:
        begin = stream.decompress(packed, _GZIPPED.size)
        if len(begin) < _GZIPPED.size or begin[:4] != b"NGSP":
            raise InputError(f"{path} does not begin like an SPZ file: copy or export it again")
        _, *numbers, flags, _ = _GZIPPED.unpack(begin)
        header = _checked_header(path, numbers, flags, most=_DEFLATE_RATIO * len(packed))
        size = _size(header)
        most = size + 1 + (_MAX_EXTENSIONS if flags & _EXTENDED else 0)
        data = stream.decompress(stream.unconsumed_tail, most) + stream.decompress(stream.unconsumed_tail, 1)
    except zlib.error as error:
        raise InputError(f"{path} is damaged or no SPZ file ({error}): copy or export it again") from error
    if len(data) < size or len(data) >= most or not stream.eof:
        raise _miscounted(path, header.count, "more" if len(data) > size else "less")
    _check_axes(path, data[size:])
    return header, data[:size]


def _unpack_plain(path: Path, packed: bytes) -> tuple[SpzHeader, bytes]:
    version = int.from_bytes(packed[4:8], "little")
    if version in (1, 2, 3):
        raise InputError(f"{path} is SPZ version {version}, unpacked: pack it with gzip, under the same name")
    if version != 4:
        raise _other_version(path, version)
    if len(packed) < _PLAIN.size:
        raise InputError(f"{path} is cut short in its header: copy it again")
    _, *numbers, flags, streams, table = _PLAIN.unpack(packed[: _PLAIN.size])
    header = _checked_header(path, numbers, flags, most=_ZSTD_RATIO * len(packed))
    blocks = [header.count * width for width in header.widths if header.count * width]
    start = table + len(blocks) * _SIZES.size
    if streams != len(blocks) or not _PLAIN.size <= table or start > len(packed):
        raise InputError(f"{path} has a table of {streams} streams at byte {table}: it is damaged, copy it again")
    if flags & _EXTENDED:
        _check_axes(path, packed[_PLAIN.size : table])
    parts = []
    for size, (length, declared) in zip(blocks, _SIZES.iter_unpack(packed[table:start]), strict=True):
        if declared != size:
            raise _miscounted(path, header.count, "more" if declared > size else "less")
        parts.append(_decompress(path, packed[start : start + length], size))
        start += length
    return header, b"".join(parts)


def _decompress(path: Path, stream: bytes, size: int) -> bytes:
    zstandard = _zstandard()
    try:
        # The library allocates what a frame says of itself, whatever its limit.
        if zstandard.frame_content_size(stream) not in (-1, size):
            raise InputError(f"{path} is damaged: a stream unpacks to another size than its table says; copy it again")
        data = zstandard.ZstdDecompressor().decompress(stream, max_output_size=size)
    except zstandard.ZstdError as error:
        raise InputError(f"{path} is damaged ({error}): copy or export it again") from error
    if len(data) != size:
        raise InputError(f"{path} is damaged: a stream unpacks to {len(data)} bytes, not {size}; copy it again")
    return data


def _checked_header(path: Path, numbers: list[int], flags: int, most: int) -> SpzHeader:
    """`most`: bytes that the file can hold."""
    version, count, degree, bits = numbers
    if version not in _POSITION_BYTES:
        raise _other_version(path, version)
    if degree >= len(_REST_COUNTS) or bits > 23:
        raise InputError(f"{path} declares SH degree {degree} and {bits} fractional bits: export it with degree 0 to 4")
    header = SpzHeader(version, count, degree, bits, bool(flags & _ANTIALIASED))
    if count > MAX_SPZ_GAUSSIANS or _size(header) > most:
        size = path.stat().st_size
        raise InputError(f"{path} declares {count} Gaussians in {size} bytes: it is damaged, copy or export it again")
    return header


def _check_axes(path: Path, records: bytes) -> None:
    while len(records) >= 8:
        kind, length = struct.unpack_from("<II", records)
        if kind == _COORDINATES and int.from_bytes(records[8:12], "little") not in _TAKEN_AS_THEY_ARE:
            raise InputError(f"{path} is neither in SPZ's axes (right, up, back) nor in a PLY's: {_MEND}")
        records = records[8 + length :]


def _size(header: SpzHeader) -> int:
    return header.count * sum(header.widths)


def _miscounted(path: Path, count: int, found: str) -> InputError:
    return InputError(f"{path} declares {count} Gaussians and holds {found}: it is damaged, copy or export it again")


def _other_version(path: Path, version: int) -> InputError:
    return InputError(f"{path} is SPZ version {version}, of which 1 to 4 are read: export it as version 3, or {_MEND}")


def _zstandard():
    try:
        import zstandard
    except ImportError as error:
        raise InputError("SPZ version 4 needs zstandard: pip install 'rein3d-jax[export]'") from error
    return zstandard
