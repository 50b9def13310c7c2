"""Scenes on their way to and from files: the alive slots as NumPy columns, checked in both directions."""

from pathlib import Path
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.scene import Gaussians

REST_COUNTS = (0, 3, 8, 15)  # coefficients above degree 0, by SH degree


class Columns(NamedTuple):
    """The fields of Gaussians, float32, alive slots only."""

    means: np.ndarray  # (n, 3) metres
    log_scales: np.ndarray  # (n, 3) log metres
    quats: np.ndarray  # (n, 4) wxyz
    opacity_logits: np.ndarray  # (n,)
    sh: np.ndarray  # (n, k, 3)


def alive_columns(gaussians: Gaussians, path: str | Path) -> Columns:
    """The alive slots, quaternions unit. Raises InputError, naming `path`, if a value is not finite or a quaternion
    has no direction."""
    alive, g = np.asarray(gaussians.alive), gaussians
    fields = (g.means, g.log_scales, g.quats, g.opacity_logits, g.sh)
    return _checked(Columns(*(np.asarray(field, np.float32)[alive] for field in fields)), path)


def from_columns(columns: Columns, path: str | Path) -> Gaussians:
    """Gaussians of the columns, every slot alive, quaternions unit. Raises InputError as alive_columns does."""
    means, log_scales, quats, opacity_logits, sh = _checked(columns, path)
    fields = (means, log_scales, quats, opacity_logits, sh, np.ones(len(means), bool))
    return Gaussians(*map(jnp.asarray, fields))


def require_finite(path: str | Path, *fields: np.ndarray) -> None:
    """Raises InputError, naming `path`, if a value of `fields`, a row a Gaussian each, is not finite."""
    if bad := sum(field.size - int(np.isfinite(field).sum()) for field in fields):
        count = len(fields[0])
        raise InputError(f"{path}: {bad} values of its {count} Gaussians are not finite: repair the scene first")


def _checked(columns: Columns, path: str | Path) -> Columns:
    require_finite(path, *columns)
    with np.errstate(over="ignore"):
        norms = np.linalg.norm(columns.quats, axis=-1, keepdims=True)
    if bad := int(((norms == 0) | np.isinf(norms)).sum()):
        raise InputError(f"{path} has {bad} quaternions without a direction: remove those splats")
    return columns._replace(quats=columns.quats / norms)
