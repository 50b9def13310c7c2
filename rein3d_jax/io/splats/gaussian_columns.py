"""Scenes on their way to and from files: the alive slots as NumPy columns, checked in both directions."""

import warnings
from pathlib import Path
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.scene import Gaussians

REST_COUNTS = (0, 3, 8, 15)  # coefficients above degree 0, by SH degree
FLATTEST = -16.0  # log metres; a splat flatter than 0.1 micrometres is as flat, even with a scale of 0
_OPAQUE = 16.0  # logit; alpha is 1 within a step of float32


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
    """Gaussians of the columns, every slot alive, quaternions unit. As viewers do, alpha 1 (logit inf) and scale 0 (log
    -inf) become the nearest that is finite, and splats with alpha 0 (logit -inf) or a quaternion of zeros are left out,
    counted in a warning. Raises InputError as alive_columns does, or if nothing is left of them."""
    means, log_scales, quats, opacity_logits, sh = _checked(_repaired(columns, path), path)
    fields = (means, log_scales, quats, opacity_logits, sh, np.ones(len(means), bool))
    return Gaussians(*map(jnp.asarray, fields))


def _repaired(columns: Columns, path: str | Path) -> Columns:
    logits, log_scales = columns.opacity_logits, columns.log_scales
    columns = columns._replace(
        opacity_logits=np.where(np.isposinf(logits), np.float32(_OPAQUE), logits),
        log_scales=np.where(np.isneginf(log_scales), np.float32(FLATTEST), log_scales),
    )
    absent, turnless = np.isneginf(logits), _lengths(columns.quats) == 0
    lost = absent | turnless
    if not lost.any():
        return columns
    counts = {"opacity 0": absent.sum(), "a quaternion of zeros": turnless.sum()}
    faults = " and ".join(f"{count} have {fault}" for fault, count in counts.items() if count)
    said = f"{path}: of its {len(lost)} Gaussians {faults}"
    if lost.all():
        raise InputError(f"{said}, so that none is left: export it again")
    warnings.warn(f"{said}; these are left out", stacklevel=3)
    return Columns(*(field[~lost] for field in columns))


def require_finite(path: str | Path, *fields: np.ndarray) -> None:
    """Raises InputError, naming `path`, if a value of `fields`, a row a Gaussian each, is not finite."""
    if bad := sum(field.size - int(np.isfinite(field).sum()) for field in fields):
        count = len(fields[0])
        raise InputError(f"{path}: {bad} values of its {count} Gaussians are not finite: repair the scene first")


def _checked(columns: Columns, path: str | Path) -> Columns:
    require_finite(path, *columns)
    lengths = _lengths(columns.quats)
    if bad := int(((lengths == 0) | np.isinf(lengths)).sum()):
        raise InputError(f"{path} has {bad} quaternions without a direction: remove those splats")
    return columns._replace(quats=columns.quats / lengths[:, None])


def _lengths(quats: np.ndarray) -> np.ndarray:
    with np.errstate(over="ignore"):
        return np.linalg.norm(quats, axis=-1)
