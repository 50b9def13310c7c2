"""PLY files as tables of their vertices: ASCII, little- or big-endian, header lines ending in LF or CRLF.

Elements before the vertices are passed over by their size; those after them are not read.
"""

import re
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.input_file import require_file

_HEADER_LIMIT = 65536  # bytes; a degree-3 scene's takes 2000
_TYPES = dict(char="i1", uchar="u1", short="i2", ushort="u2", int="i4", uint="u4", float="f4", double="f8")
_TYPES |= dict(int8="i1", uint8="u1", int16="i2", uint16="u2", int32="i4", uint32="u4", float32="f4", float64="f8")
_ASCII = "="  # among byte orders
_FORMATS = {f"format binary_{end}_endian 1.0": order for end, order in (("little", "<"), ("big", ">"))}
_FORMATS |= {"format ascii 1.0": _ASCII}


class Vertices(NamedTuple):
    """Where a PLY's vertices lie; the file is as long as they need."""

    count: int
    row: np.dtype  # properties, in the file's order
    start: int  # bytes before the vertices; in ASCII before the first element
    lines: int  # of ASCII, between `start` and the vertices
    ascii: bool


class _Element(NamedTuple):
    name: str
    count: int
    properties: list[tuple[str, str]]  # name, NumPy type
    lists: list[str]  # names of properties whose size each row tells


def header_lines(path: Path) -> tuple[list[list[str]], int]:
    """Words of each header line that is no comment, and the header's bytes; none and 0 if no header ends within
    _HEADER_LIMIT. Raises InputError if the file cannot be read."""
    require_file(path)
    with open(path, "rb") as file:
        head = file.read(_HEADER_LIMIT)
    end = re.search(rb"^end_header[ \t]*\r?\n", head, re.MULTILINE)
    if not end:
        return [], 0
    lines = [line.split() for line in head[: end.start()].decode("ascii", "replace").splitlines()]
    return [words for words in lines if words and words[0] not in ("comment", "obj_info")], end.end()


def find_vertices(path: Path) -> Vertices:
    """The layout of the element `vertex`. Raises InputError if the header is none, a list property hides where a
    vertex lies, or the file is shorter than it declares."""
    lines, start = header_lines(path)
    magic = [" ".join(words) for words in lines[:2]]
    if magic[:1] != ["ply"] or magic[-1] not in _FORMATS:
        raise InputError(f"{path} is no PLY file of version 1.0: copy it again, or export it as a 3DGS PLY")
    order = _FORMATS[magic[-1]]
    try:
        elements = _parse_elements(lines[2:], order)
        place = [element.name for element in elements].index("vertex")
        vertex, row = elements[place], np.dtype(elements[place].properties)
    except (ValueError, KeyError, IndexError) as error:
        raise InputError(f"{path} has a PLY header that is no scene's ({error}): export it as a 3DGS PLY") from error
    before, ascii = [element for element in elements[:place] if element.count], order == _ASCII
    _require_no_lists(path, [vertex] if ascii else [*before, vertex])
    passed = sum(element.count * (1 if ascii else _row_bytes(element)) for element in before)
    found = Vertices(vertex.count, row, *((start, passed) if ascii else (start + passed, 0)), ascii)
    _require_length(path, found)
    return found


def read_columns(path: Path, vertices: Vertices, names: list[str]) -> np.ndarray:
    """The properties `names` of every vertex, float32 (count, names). Raises InputError if a word of an ASCII file is
    no number or a line is missing."""
    if vertices.ascii:
        return _read_ascii(path, vertices, [vertices.row.names.index(name) for name in names])
    rows = np.fromfile(path, vertices.row, vertices.count, offset=vertices.start)
    with np.errstate(over="ignore"):  # a double beyond float32 becomes infinite
        return np.stack([rows[name] for name in names], axis=1, dtype=np.float32, casting="same_kind")


def _parse_elements(lines: list[list[str]], byte_order: str) -> list[_Element]:
    elements = []
    for words in lines:
        match words:
            case ["element", name, count] if count.isdecimal():
                elements.append(_Element(name, int(count), [], []))
            case ["property", "list", _, _, name]:
                elements[-1].lists.append(name)
            case ["property", kind, name]:
                elements[-1].properties.append((name, byte_order + _TYPES[kind]))
            case _:
                raise ValueError(" ".join(words)[:80])
    return elements


def _row_bytes(element: _Element) -> int:
    return sum(np.dtype(kind).itemsize for _, kind in element.properties)


def _require_no_lists(path: Path, elements: list[_Element]) -> None:
    for element in elements:
        if element.lists:
            raise InputError(f"{path} has the list property {element.lists[0]} in its element {element.name}, which"
                             " hides where vertices lie: export it as a 3DGS PLY, which has no lists")  # fmt: skip


def _require_length(path: Path, vertices: Vertices) -> None:
    """Before anything is allocated. A value of an ASCII file takes two bytes, the last one of all perhaps one."""
    size, per_row = path.stat().st_size, vertices.row.itemsize
    if vertices.ascii:
        per_row, size = 2 * len(vertices.row.names), size + 1 - vertices.lines
    held = max(size - vertices.start, 0) // max(per_row, 1)
    if vertices.count > held:
        most = "at most " * vertices.ascii
        raise InputError(f"{path} declares {vertices.count} vertices but holds {most}{held}: "
                         "it is cut short, copy it again")  # fmt: skip


def _read_ascii(path: Path, vertices: Vertices, places: list[int]) -> np.ndarray:
    if not vertices.count:
        return np.zeros((0, len(places)), np.float32)
    with open(path, "rb") as file:
        file.seek(vertices.start)
        text = (line.decode("ascii", "replace") for line in file if not line.isspace())
        rows = islice(text, vertices.lines, vertices.lines + vertices.count)
        try:
            table = np.loadtxt(rows, np.float32, comments=None, usecols=places, ndmin=2)
        except ValueError as error:
            raise InputError(f"{path} is damaged ({str(error).splitlines()[0]}): export it again") from error
    if len(table) < vertices.count:
        raise InputError(f"{path} declares {vertices.count} vertices but holds {len(table)}: "
                         "it is cut short, copy it again")  # fmt: skip
    return table
