"""Scenes as .splat, the 32 bytes a Gaussian of antimatter15's web viewer (github.com/antimatter15/splat).

x y z (float32)  scale x y z (float32, metres)  r g b opacity (uint8)  quaternion w x y z (uint8, 128 + 128 q)

The axes are the world's, as in scene.ply: +Z up. The format holds one colour a Gaussian: what changes with the
direction of view (SH degree 1 and up) is left out, and colours outside [0, 1] are clipped.
"""

from pathlib import Path

import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.geometry.spherical_harmonics import C0, sh_from_rgb
from rein3d_jax.io.files.atomic import write_bytes
from rein3d_jax.io.files.input_file import require_file
from rein3d_jax.io.splats.gaussian_columns import FLATTEST, Columns, alive_columns, from_columns
from rein3d_jax.io.splats.quantise import alpha_bytes, alpha_logits, from_levels, to_levels
from rein3d_jax.scene import Gaussians

_SPLAT = np.dtype([("means", "<f4", 3), ("scales", "<f4", 3), ("rgb", "u1", 3), ("alpha", "u1"), ("quats", "u1", 4)])
_LOG_SCALES = (FLATTEST, 80.0)  # log metres


def write_splat(path: str | Path, gaussians: Gaussians) -> None:
    """Writes the alive slots, atomically. Raises InputError, and writes nothing, if a value is not finite."""
    columns = alive_columns(gaussians, path)
    table = np.zeros(len(columns.means), _SPLAT)
    table["means"], table["scales"] = columns.means, np.exp(np.clip(columns.log_scales, *_LOG_SCALES))
    table["rgb"] = to_levels(0.5 + C0 * columns.sh[:, 0], 8)
    table["alpha"] = alpha_bytes(columns.opacity_logits)
    table["quats"] = np.clip(np.round(128 + 128 * columns.quats), 0, 255)
    write_bytes(path, table.tobytes())


def read_splat(path: str | Path) -> Gaussians:
    """The scene in a .splat file, degree 0, every slot alive. Raises InputError if it is missing, no whole number of
    Gaussians long, or if it holds a scale below 0; and as from_columns does."""
    path = Path(path)
    require_file(path)
    if (size := path.stat().st_size) % _SPLAT.itemsize:
        raise InputError(f"{path} has {size} bytes, no multiple of 32: it is cut short, copy or export it again")
    table = np.fromfile(path, _SPLAT)
    scales = table["scales"]
    if bad := int((scales < 0).sum()):
        raise InputError(f"{path} has {bad} scales below 0: it is damaged or no .splat file, export it again")
    quats = (table["quats"].astype(np.float32) - 128) / 128
    sh = sh_from_rgb(from_levels(table["rgb"], 8)).astype(np.float32)[:, None]
    log_scales = np.log(np.maximum(scales, np.exp(np.float32(FLATTEST))))
    means = np.ascontiguousarray(table["means"])
    return from_columns(Columns(means, log_scales, quats, alpha_logits(table["alpha"]), sh), path)
