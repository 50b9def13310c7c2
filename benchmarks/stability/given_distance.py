"""Regimes of the distance that comes with a picture: it is noisy, bent, blurred, shifted, in other units, or has holes.
In furnished drawn rooms; all methods get the same spoiled map."""

from collections.abc import Callable
from dataclasses import replace

import cv2
import jax.numpy as jnp
import numpy as np

from benchmarks.stability.case import Case, case_of, drawn_room, figures_of
from benchmarks.stability.methods import METHODS, ours
from benchmarks.stability.regime import ASTRAY, HIDDEN, SEEN, Figures, Regime
from rein3d_jax.conventions import EYE_HEIGHT
from rein3d_jax.depth.level import estimate_lean, level_panorama
from rein3d_jax.depth.scale import height_above_floor
from rein3d_jax.geometry.rotations import matrix_from_quats
from rein3d_jax.geometry.sphere import pixel_rays
from rein3d_jax.scene import Panorama

HEIGHT_KNOWN, LEVELLED = "ours, height known", "ours, levelled"
_CASES: dict[int, Case] = {}

Spoil = Callable[[Panorama, float, np.random.Generator], Panorama]


def furnished(seed: int) -> Case:
    """The furnished room of a seed, made once."""
    if seed not in _CASES:
        _CASES[seed] = case_of(drawn_room(seed))
    return _CASES[seed]


def compare(case: Case) -> dict[str, Figures]:
    """All methods' figures."""
    return {name: figures_of(case, method(case.given)) for name, method in METHODS.items()}


def spoiled_by(spoil: Spoil) -> Callable[[float, int], dict[str, Figures]]:
    """The measure of a regime that spoils what is given."""

    def measure(severity: float, seed: int) -> dict[str, Figures]:
        rng = np.random.default_rng([seed, 17])
        return compare(furnished(seed).spoiled(lambda panorama: spoil(panorama, severity, rng)))

    return measure


def _with(panorama: Panorama, distance: np.ndarray) -> Panorama:
    return replace(panorama, distance=jnp.asarray(distance, jnp.float32))


def _noisy(panorama: Panorama, percent: float, rng: np.random.Generator) -> Panorama:
    noise = np.exp(percent / 100 * rng.normal(size=panorama.distance.shape))
    return _with(panorama, panorama.distance * noise)


def _bent(panorama: Panorama, percent: float, rng: np.random.Generator) -> Panorama:
    rays = np.asarray(pixel_rays(*panorama.distance.shape))
    waves = sum(np.sin(rays @ rng.normal(scale=2.5, size=3) + rng.uniform(0, 6.3)) for _ in range(4)) / np.sqrt(2)
    return _with(panorama, panorama.distance * np.exp(percent / 100 * waves))


def _blurred(panorama: Panorama, sigma: float, _) -> Panorama:
    distance = np.asarray(panorama.distance)
    if sigma:
        wide = np.pad(distance, ((0, 0), (32, 32)), mode="wrap")
        distance = cv2.GaussianBlur(wide, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE)[:, 32:-32]
    return _with(panorama, distance)


def _shifted(panorama: Panorama, columns: float, _) -> Panorama:
    return _with(panorama, np.roll(np.asarray(panorama.distance), int(columns), axis=1))


def _holed(panorama: Panorama, percent: float, rng: np.random.Generator, block: int = 1) -> Panorama:
    rows, columns = (size // block for size in panorama.distance.shape)
    gone = np.zeros(rows * columns, bool)
    gone[rng.permutation(gone.size)[: round(gone.size * percent / 100)]] = True
    gone = np.kron(gone.reshape(rows, columns), np.ones((block, block), bool))
    return replace(panorama, valid=panorama.valid & ~jnp.asarray(gone))


def _in_blocks(panorama: Panorama, percent: float, rng: np.random.Generator) -> Panorama:
    return _holed(panorama, percent, rng, block=8)


def _stepped(panorama: Panorama, bits: float, _) -> Panorama:
    distance = np.asarray(panorama.distance)
    levels = 2 ** (16 - bits) - 1
    return _with(panorama, np.maximum(np.round(distance / distance.max() * levels), 1) / levels * distance.max())


def _scaled(factor: float, seed: int) -> dict[str, Figures]:
    case = furnished(seed).spoiled(lambda panorama: _with(panorama, factor * panorama.distance))
    mended = case.spoiled(lambda panorama: _with(panorama, panorama.distance * _mend(panorama)))
    return compare(case) | {HEIGHT_KNOWN: figures_of(mended, ours(mended.given))}


def _mend(panorama: Panorama) -> float:
    """What brings the map to metres, of a camera known to stand at eye height."""
    return EYE_HEIGHT / height_above_floor(panorama)


def _leaning(degrees: float, seed: int) -> dict[str, Figures]:
    """Rolled by `degrees` and not told; and with the level stage before."""
    half = np.radians(degrees) / 2
    rotation = matrix_from_quats(jnp.array([np.cos(half), np.sin(half), 0.0, 0.0]))
    upright = furnished(seed)
    leaning = replace(upright, given=level_panorama(upright.given, rotation), given_from_true=rotation)
    level = estimate_lean(leaning.given.rgb).level_from_picture
    raised = level_panorama(leaning.given, level)
    levelled = replace(leaning, given=raised, given_from_true=jnp.matmul(level, rotation, precision="highest"))
    return compare(leaning) | {LEVELLED: figures_of(levelled, ours(levelled.given))}


REGIMES = (
    Regime("noise of the distance", "gravel, and fog beside edges", "deviation, % a pixel", (0, 2, 5, 10, 20), 0, SEEN,
           spoiled_by(_noisy)),
    Regime("bent distance", "walls that swim as one walks", "deviation, %, waves of a metre", (0, 5, 10, 20, 40), 0,
           SEEN, spoiled_by(_bent)),
    Regime("blurred distance", "flying pixels between things and walls", "sigma, pixels of 64 rows",
           (0, 0.5, 1, 2, 4), 0, ASTRAY, spoiled_by(_blurred), rows="6"),
    Regime("shifted distance", "the edges' colours on the wrong surface", "columns of 128", (0, 1, 2, 4, 8), 0, SEEN,
           spoiled_by(_shifted)),
    Regime("coarse steps of distance", "terraces", "bits lost of 16", (0, 4, 8, 10, 12, 13), 0, SEEN,
           spoiled_by(_stepped)),
    Regime("wrong scale", "things pass too fast, or too slowly", "given over true", (0.5, 0.7, 0.85, 1, 1.2, 1.4, 2), 1,
           SEEN, _scaled, rows="7"),
    Regime("missing at random", "a moth-eaten map", "% of the pixels", (0, 10, 30, 60, 90), 0, SEEN,
           spoiled_by(_holed), rows="8"),
    Regime("missing in blocks", "windows, black furniture", "% in blocks of 22 degrees", (0, 10, 20, 40, 60), 0, SEEN,
           spoiled_by(_in_blocks), rows="8"),
    Regime("leaning camera", "floors that climb; things' backs missing", "degrees of roll", (0, 2, 4, 8, 15), 0,
           HIDDEN, _leaning),
)  # fmt: skip
