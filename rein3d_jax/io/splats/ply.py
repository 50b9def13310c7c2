"""Scenes as PLY: the binary layout of the 3DGS paper's code (Kerbl et al. 2023), which every splat viewer opens.

x y z  nx ny nz (0)  f_dc_0..2  f_rest_0..(3k - 1), channel-major  opacity (logit)  scale_0..2 (log)  rot_0..3 (wxyz)
"""

from pathlib import Path

import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import atomic_path
from rein3d_jax.io.files.input_file import require_file
from rein3d_jax.io.splats.gaussian_columns import REST_COUNTS, Columns, from_columns, require_finite
from rein3d_jax.scene import Gaussians

_NORMALS = ["nx", "ny", "nz"]  # always 0: viewers expect the columns, nobody reads them
_ANTIALIASED = "comment antialiased (Mip-Splatting, eq. 9)"
_HEADER_LIMIT = 65536  # bytes; a degree-3 header takes 1500
_TYPES = dict(char="i1", uchar="u1", short="i2", ushort="u2", int="i4", uint="u4", float="f4", double="f8")
_TYPES |= dict(int8="i1", uint8="u1", int16="i2", uint16="u2", int32="i4", uint32="u4", float32="f4", float64="f8")


def write_ply(path: str | Path, gaussians: Gaussians, *, antialias: bool = False) -> None:
    """Writes the alive slots, atomically. `antialias` says in the header that the scene was made for a rasterizer that
    scales opacity by what its filter spreads out; the layout has no field for it, and one that does not shows small
    splats too dense. Raises InputError, and writes nothing, if any value is not finite."""
    table = _table(gaussians)
    require_finite(path, table)
    names = _property_names(table.shape[1] - 17)
    names[3:3] = _NORMALS
    lines = ["ply", "format binary_little_endian 1.0", *[_ANTIALIASED] * antialias, f"element vertex {len(table)}"]
    lines += [f"property float {name}" for name in names] + ["end_header", ""]
    with atomic_path(path) as temporary, open(temporary, "wb") as file:
        file.write("\n".join(lines).encode())
        file.write(table.data)


def read_ply(path: str | Path) -> Gaussians:
    """The scene in a binary little-endian 3DGS PLY, every slot alive, quaternions made unit. Properties may come
    in any order, others are skipped. Raises InputError, before allocation, if a property is missing or the file
    is shorter than it declares; and if a value is not finite or a quaternion has no direction."""
    path = Path(path)
    count, vertex, start = _read_layout(path)
    rest = _rest_count(path, vertex)
    names = _property_names(rest)
    if missing := [name for name in names if name not in vertex.names]:
        raise InputError(f"{path} lacks the properties {', '.join(missing)}: export it as a 3DGS PLY")
    vertices = np.fromfile(path, vertex, count, offset=start)
    table = np.stack([vertices[name] for name in names], axis=1, dtype=np.float32, casting="same_kind")
    means, dc, higher, opacity, log_scales, quats = np.split(table, np.cumsum([3, 3, rest, 1, 3]), axis=1)
    sh = np.concatenate([dc[:, None], higher.reshape(count, 3, rest // 3).swapaxes(1, 2)], axis=1)
    return from_columns(Columns(means, log_scales, quats, opacity[:, 0], sh), path)


def _property_names(rest: int) -> list[str]:
    """All but the normals, in the file's order."""

    def numbered(stem: str, count: int) -> list[str]:
        return [f"{stem}_{i}" for i in range(count)]

    colour = numbered("f_dc", 3) + numbered("f_rest", rest)
    return [*"xyz", *colour, "opacity", *numbered("scale", 3), *numbered("rot", 4)]


def _table(gaussians: Gaussians) -> np.ndarray:
    """(alive, 17 + 3 k) little-endian float32, columns in the file's order."""
    g, alive = gaussians, np.asarray(gaussians.alive)
    fields = (g.means, g.log_scales, g.quats, g.opacity_logits, g.sh)
    means, scales, quats, opacity, sh = (np.asarray(field)[alive] for field in fields)
    rest = sh[:, 1:].swapaxes(1, 2).reshape(len(sh), 3 * (sh.shape[1] - 1))
    columns = [means, np.zeros_like(means), sh[:, 0], rest, opacity[:, None], scales, quats]
    return np.concatenate(columns, axis=1, dtype="<f4")


def _read_layout(path: Path) -> tuple[int, np.dtype, int]:
    """Vertex count, vertex layout and the byte where vertices start, checked against the file's size."""
    require_file(path)
    with open(path, "rb") as file:
        head, mark, _ = file.read(_HEADER_LIMIT).partition(b"end_header\n")
    count, vertex = _parse_header(path, head if mark else b"")
    start, size = len(head) + len(mark), path.stat().st_size
    if start + count * vertex.itemsize > size:
        held = (size - start) // vertex.itemsize
        raise InputError(f"{path} declares {count} vertices but holds {held}: it is cut short, copy it again")
    return count, vertex, start


def _rest_count(path: Path, vertex: np.dtype) -> int:
    count = sum(name.startswith("f_rest_") for name in vertex.names)
    if count not in [3 * rest for rest in REST_COUNTS]:
        raise InputError(f"{path} has {count} f_rest properties: export it with SH degree 0 to 3 (0, 9, 24 or 45)")
    return count


def _parse_header(path: Path, head: bytes) -> tuple[int, np.dtype]:
    """Vertex count and layout. The vertices must come first; what follows them is not read."""
    lines = [line.split() for line in head.decode("ascii", "replace").splitlines()]
    lines = [words for words in lines if words and words[0] not in ("comment", "obj_info")]
    if lines[:2] != [["ply"], ["format", "binary_little_endian", "1.0"]]:
        raise InputError(f"{path} is not a binary little-endian PLY: export it as one")
    elements = [i for i, words in enumerate(lines) if words[0] == "element"]
    try:
        _, name, count = lines[elements[0]]
        body = lines[elements[0] + 1 : [*elements, len(lines)][1]]
        if name != "vertex" or int(count) < 0:
            raise ValueError(f"the first element is {name} {count}")
        return int(count), np.dtype([(name, "<" + _TYPES[kind]) for _, kind, name in body])
    except (ValueError, KeyError, IndexError) as error:
        raise InputError(f"{path} has a PLY header that is no scene's ({error}): export it as a 3DGS PLY") from error
