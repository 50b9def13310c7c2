"""Scenes as PLY: the binary layout of the 3DGS paper's code (Kerbl et al. 2023), which every splat viewer opens.

x y z  nx ny nz (0)  f_dc_0..2  f_rest_0..(3k - 1), channel-major  opacity (logit)  scale_0..2 (log)  rot_0..3 (wxyz)
"""

import math
import warnings
from pathlib import Path

import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.geometry.spherical_harmonics import sh_from_rgb
from rein3d_jax.io.files.atomic import atomic_path
from rein3d_jax.io.splats.gaussian_columns import REST_COUNTS, Columns, from_columns, require_finite
from rein3d_jax.io.splats.ply_table import find_vertices, read_columns
from rein3d_jax.scene import Gaussians

_NORMALS = ["nx", "ny", "nz"]  # always 0: viewers expect the columns, nobody reads them
_ANTIALIASED = "comment SplatRenderMode: mip"  # Mip-Splatting, eq. 9, as Brush and SuperSplat say it
_RGB = ["red", "green", "blue"]  # bytes: what nerfstudio writes for f_dc with --ply-color-mode rgb


def write_ply(path: str | Path, gaussians: Gaussians, *, antialias: bool = False, axes: str = "Z up") -> None:
    """Writes the alive slots, atomically. `axes` is what the header says of them; `antialias` says there that the scene
    was made for a rasterizer that scales opacity by what its filter spreads out: the layout has no field for it, and
    one that does not shows small splats too dense. Raises InputError, and writes nothing, if any value is not finite.
    """
    table = _table(gaussians)
    require_finite(path, table)
    names = _property_names(_numbered("f_dc", 3), _numbered("f_rest", table.shape[1] - 17))
    names[3:3] = _NORMALS
    lines = ["ply", "format binary_little_endian 1.0", f"comment {axes}, metres, right-handed"]
    lines += [*[_ANTIALIASED] * antialias, f"element vertex {len(table)}"]
    lines += [f"property float {name}" for name in names] + ["end_header", ""]
    with atomic_path(path) as temporary, open(temporary, "wb") as file:
        file.write("\n".join(lines).encode())
        file.write(table.data)


def read_ply(path: str | Path) -> Gaussians:
    """The scene in a 3DGS PLY, binary or ASCII, every slot alive, quaternions made unit. Properties may come in any
    order, others are skipped; degrees above 3 are left out, with a warning. Raises InputError, before allocation, if a
    property is missing or the file is shorter than it declares; and as from_columns does."""
    path = Path(path)
    vertices = find_vertices(path)
    held = vertices.row.names
    dc, rest = _dc_names(vertices.row), _rest_names(path, held)
    names = _property_names(dc, rest)
    if missing := [name for name in names if name not in held]:
        raise InputError(f"{path} lacks the properties {', '.join(missing)}: export it as a 3DGS PLY")
    table = read_columns(path, vertices, names)
    means, colour, higher, opacity, log_scales, quats = np.split(table, np.cumsum([3, 3, len(rest), 1, 3]), axis=1)
    colour = sh_from_rgb(colour / 255) if dc == _RGB else colour
    higher = higher.reshape(len(table), 3, len(rest) // 3).swapaxes(1, 2)
    sh = np.concatenate([colour[:, None], higher], axis=1)
    return from_columns(Columns(means, log_scales, quats, opacity[:, 0], sh), path)


def _property_names(dc: list[str], rest: list[str]) -> list[str]:
    """All but the normals, in the file's order."""
    return [*"xyz", *dc, *rest, "opacity", *_numbered("scale", 3), *_numbered("rot", 4)]


def _numbered(stem: str, count: int) -> list[str]:
    return [f"{stem}_{i}" for i in range(count)]


def _dc_names(row: np.dtype) -> list[str]:
    dc = _numbered("f_dc", 3)
    in_bytes = all(name in row.names and row[name] == np.uint8 for name in _RGB)
    return _RGB if in_bytes and not set(dc) & set(row.names) else dc


def _rest_names(path: Path, held: tuple[str, ...]) -> list[str]:
    """Of each channel's f_rest properties those up to degree 3."""
    count = sum(name.startswith("f_rest_") for name in held)
    per_channel, degree = count // 3, math.isqrt(count // 3 + 1) - 1
    if count != 3 * ((degree + 1) ** 2 - 1):
        raise InputError(f"{path} has {count} f_rest properties: export it with SH degree 0 to 3 (0, 9, 24 or 45)")
    if degree >= len(REST_COUNTS):
        warnings.warn(f"{path} has SH degree {degree}, of which degrees 0 to 3 are read", stacklevel=3)
    kept = min(per_channel, REST_COUNTS[-1])
    return [f"f_rest_{channel * per_channel + i}" for channel in range(3) for i in range(kept)]


def _table(gaussians: Gaussians) -> np.ndarray:
    """(alive, 17 + 3 k) little-endian float32, columns in the file's order."""
    g, alive = gaussians, np.asarray(gaussians.alive)
    fields = (g.means, g.log_scales, g.quats, g.opacity_logits, g.sh)
    means, scales, quats, opacity, sh = (np.asarray(field)[alive] for field in fields)
    rest = sh[:, 1:].swapaxes(1, 2).reshape(len(sh), 3 * (sh.shape[1] - 1))
    columns = [means, np.zeros_like(means), sh[:, 0], rest, opacity[:, None], scales, quats]
    return np.concatenate(columns, axis=1, dtype="<f4")
