"""NPY and NPZ files: never unpickled, and no array is allocated before its declared size was checked."""

import math
import os
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tokenize import TokenError
from typing import IO, NamedTuple

import numpy as np
from numpy.lib import format as npy_format

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.input_file import require_file

_DAMAGE = (
    OSError,
    ValueError,
    EOFError,
    KeyError,
    RuntimeError,
    MemoryError,
    TokenError,
    zipfile.BadZipFile,
    zlib.error,
)
_READ_HEADER = {(1, 0): npy_format.read_array_header_1_0, (2, 0): npy_format.read_array_header_2_0}


class Header(NamedTuple):
    """Shape and type of a stored array."""

    shape: tuple[int, ...]
    dtype: np.dtype


def read_headers(path: Path) -> dict[str, Header]:
    """The header of every array in an NPZ file by name, or of an NPY file's one array, named "".

    Raises InputError if the file is missing or damaged, or if it is shorter than its headers say.
    """
    require_file(path)
    with _damage_named(path):
        if not zipfile.is_zipfile(path):
            with open(path, "rb") as stream:
                return {"": _read_header(stream, os.path.getsize(path))}
        with zipfile.ZipFile(path) as archive:
            return {info.filename.removesuffix(".npy"): _member_header(archive, info) for info in archive.infolist()}


def read_arrays(path: Path, names: list[str]) -> list[np.ndarray]:
    """The arrays `names` of a file whose headers `read_headers` returned and the caller has judged."""
    with _damage_named(path):
        loaded = np.load(path, allow_pickle=False)
        if isinstance(loaded, np.ndarray):
            return [loaded for _ in names]
        with loaded:
            return [loaded[name] for name in names]


def _member_header(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> Header:
    with archive.open(info) as stream:
        return _read_header(stream, info.file_size)


def _read_header(stream: IO[bytes], size: int) -> Header:
    shape, _, dtype = _READ_HEADER[npy_format.read_magic(stream)](stream)
    if dtype.hasobject:
        raise ValueError("it holds Python objects, which are never unpickled")
    if stream.tell() + math.prod(shape) * dtype.itemsize > size:
        raise ValueError(f"{shape} {dtype} is more than it holds")
    return Header(shape, dtype)


@contextmanager
def _damage_named(path: Path) -> Iterator[None]:
    try:
        yield
    except _DAMAGE as error:
        reason = " ".join(str(error).split())
        raise InputError(f"{path} is damaged or no NPY or NPZ file ({reason}): write it again") from error
