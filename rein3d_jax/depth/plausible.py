"""Whether a map's distances can be a room's, and what else it may hold. A plane's inverse distance is linear in the
ray, 1 / d = n . r / c, and no other function of the distance is: a map read as what it is has flat surfaces.

Measured on 48 panoramas of traced rooms and 100 boxes, as distance, z, disparity (also normalised to 0..1), with 1 % of
noise, with 3 % and with waves of 5 %: the kind was told right each time, and so it was on the depth network's maps."""

import numpy as np

from rein3d_jax.conventions import EYE_HEIGHT
from rein3d_jax.depth.kinds import along_ray
from rein3d_jax.depth.scale import height_above_floor
from rein3d_jax.errors import InputError
from rein3d_jax.geometry.sphere import pixel_rays64
from rein3d_jax.scene import Panorama

_NEAREST, _FARTHEST = 0.5, 30.0  # metres, of the median of a room
_LOWEST, _HIGHEST = 0.3, 3.5  # metres of a camera above the floor
_SMALLEST = 1.2  # metres: someone who stands sees their feet farther than that
_ROWS, _PATCH = 64, 8  # of the map that is looked at, and of a patch of it: 22 degrees
_SMOOTH = 0.03  # greatest relative deviation (rms) of a patch from a plane that tells something
_ENOUGH = 8  # patches


def implausible_size(panorama: Panorama) -> str:
    """What no room has, in words, of the distances in metres of a panorama with some known; "" for a room's."""
    known = np.asarray(panorama.distance)[np.asarray(panorama.valid)]
    median, far = np.percentile(known, [50, 99.9])
    if median > _FARTHEST:
        return f"a median of {median:.3g} m: no room is so large"
    if median < _NEAREST or far < _SMALLEST:
        return f"nothing farther than {far:.2g} m: no room is so small"
    height = _height(panorama)
    if not _LOWEST < height < _HIGHEST:
        return f"a floor {height:.2g} m below the camera: no camera stands there"
    return ""


def _height(panorama: Panorama) -> float:
    """Metres of the camera above the floor; someone's eye height where no floor shows."""
    try:
        return height_above_floor(panorama)
    except InputError:
        return EYE_HEIGHT


def flattest_kind(panorama: Panorama, kinds: tuple[str, ...]) -> str:
    """The one of `kinds` as which the numbers of a panorama's `distance` (h, 2 h) make most of its surfaces plane; the
    first one unless another has two thirds of the patches of the map that tell. A map of one number, which is a sphere
    as much as a cube, tells nothing."""
    known = np.asarray(panorama.distance)[np.asarray(panorama.valid)]
    if not known.size or np.ptp(np.percentile(known, [1, 99])) < 0.01 * np.median(known):
        return kinds[0]
    deviations = np.stack([_deviations(along_ray(panorama, kind)) for kind in kinds])
    best = np.argmin(deviations[:, np.min(deviations, axis=0) < _SMOOTH], axis=0)
    votes = np.bincount(best, minlength=len(kinds))
    return kinds[int(np.argmax(votes))] if best.size >= _ENOUGH and votes.max() > 2 / 3 * best.size else kinds[0]


def _deviations(panorama: Panorama) -> np.ndarray:
    """Relative deviation (n,) of each patch's inverse distance from a plane's; inf where something is unknown."""
    stride = max(len(panorama.distance) // _ROWS, 1)
    grid = np.s_[stride // 2 :: stride, stride // 2 :: stride]
    rays = _patches(pixel_rays64(len(panorama.distance))[grid])
    valid = _patches(np.asarray(panorama.valid)[grid][..., None])[..., 0].all(axis=1)
    distance = _patches(np.asarray(panorama.distance, np.float64)[grid][..., None])[..., 0]
    inverse = 1 / np.where(valid[:, None], distance, 1)
    plane = np.einsum("nij,njk,nk->ni", rays, np.linalg.pinv(rays), inverse)
    deviation = np.sqrt(np.mean((plane - inverse) ** 2, axis=1)) / np.mean(inverse, axis=1)
    return np.where(valid, deviation, np.inf)


def _patches(values: np.ndarray) -> np.ndarray:
    """The patches (n, _PATCH^2, c) of (h, w, c); what is left over at the ends is left out."""
    rows, columns = (size // _PATCH for size in values.shape[:2])
    cut = values[: rows * _PATCH, : columns * _PATCH].reshape(rows, _PATCH, columns, _PATCH, -1)
    return cut.swapaxes(1, 2).reshape(rows * columns, _PATCH**2, -1)
