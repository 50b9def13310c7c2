"""Figures of one room: pictures against the truth, also by what the input knew of each pixel and by how far the camera
stood from it. A figure that has no pixels or no pictures is NaN.

Figures of whole pictures (`psnr`, `ssim`, ...) are means over pictures. A split by pixels (`psnr_hole`, ...) is taken
over all such pixels of the room at once: a picture with three of them has no say of its own.
"""

from collections.abc import Callable, Mapping
from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np

from rein3d_jax.evaluate.distance_error import distance_errors
from rein3d_jax.evaluate.lpips import lpips
from rein3d_jax.evaluate.metrics import psnr, ssim, ws_psnr, ws_ssim
from rein3d_jax.evaluate.seam import seam_error
from rein3d_jax.geometry.resample import pad_sphere
from rein3d_jax.geometry.sphere import latitudes, pixel_solid_angles
from rein3d_jax.geometry.structural_similarity import WINDOW, ssim_map

BEST_PSNR = 100.0  # dB, beyond any 8-bit picture: an exact one has infinite PSNR, which JSON cannot say
EDGES = (0.0, 0.5, 1.0, 2.0, 3.0, np.inf)  # metres from the input to the camera

Figures = dict[str, float]
Masks = Mapping[str, jax.Array]  # name -> (n, h, w) bool


def picture_figures(shown: jax.Array, truth: jax.Array, masks: Masks, metres: np.ndarray, weights: Mapping) -> Figures:
    """Figures psnr, ssim and lpips of (n, h, w, 3) against (n, h, w, 3), taken `metres` (n,) from the input; `weights`
    are those of LPIPS."""
    each = {"psnr": _capped(psnr(shown, truth)), "ssim": ssim(shown, truth)}
    each["lpips"] = jnp.concatenate(
        [lpips(weights, *pair) for pair in zip(shown[:, None], truth[:, None], strict=True)]
    )
    similar = _similar(shown, truth)
    edge = WINDOW // 2
    split = {
        "psnr": lambda mask: _psnr_within(shown, truth, mask),
        "ssim": lambda mask: _mean_within(similar, mask[:, edge:-edge, edge:-edge]),
    }
    shares = {f"share_{name}": float(jnp.mean(mask)) for name, mask in masks.items()}
    return _by_distance(each, metres) | _by_mask(split, masks) | shares


def sphere_figures(shown: jax.Array, truth: jax.Array, masks: Masks, metres: np.ndarray) -> Figures:
    """Figures ws_psnr, ws_ssim and seam of panoramas (n, h, 2 h, 3), pixels weighted by area, and `seam_truth`."""
    each = {"ws_psnr": _capped(ws_psnr(shown, truth)), "ws_ssim": ws_ssim(shown, truth)}
    area = jnp.cos(latitudes(shown.shape[1]))[:, None]
    similar = _similar(*(jax.vmap(lambda one: pad_sphere(one, WINDOW // 2))(x) for x in (shown, truth)))
    split = {
        "ws_psnr": lambda mask: _psnr_within(shown, truth, mask * area),
        "ws_ssim": lambda mask: _mean_within(similar, mask * area),
    }
    seams = {"seam": _mean(seam_error(shown)), "seam_truth": _mean(seam_error(truth))}
    return _by_distance(each, metres) | _by_mask(split, masks) | seams


def distance_figures(shown: jax.Array, truth: jax.Array, masks: Masks, metres: np.ndarray) -> Figures:
    """Figures abs_rel and delta_1.25 of panoramic distances (n, h, 2 h), 0 where unknown; a hole is an error of 1."""
    area = pixel_solid_angles(*truth.shape[1:])

    def errors(mask):
        found = distance_errors(shown, truth, mask)
        return {"abs_rel": found.abs_rel, "delta_1.25": found.delta}

    def pooled(name):
        def within(mask):
            return _mean_within(errors(mask)[name], jnp.sum(mask * (truth > 0) * area, axis=(1, 2)))

        return within

    split = {name: pooled(name) for name in ("abs_rel", "delta_1.25")}
    return _by_distance(errors(truth > 0), metres) | _by_mask(split, masks)


def _by_distance(each: Mapping[str, jax.Array], metres: np.ndarray) -> Figures:
    """The mean of each figure (n,), and of what was taken at each distance."""
    figures = {}
    for name, values in each.items():
        figures[name] = _mean(values)
        for low, high in pairwise(EDGES):
            label = f"{low:g}m+" if np.isinf(high) else f"{low:g}-{high:g}m"
            figures[f"{name}_at_{label}"] = _mean(np.asarray(values)[(metres >= low) & (metres < high)])
    return figures


def _by_mask(split: Mapping[str, Callable[[jax.Array], float]], masks: Masks) -> Figures:
    return {f"{name}_{kind}": of(mask) for name, of in split.items() for kind, mask in masks.items()}


def _mean(values: jax.Array) -> float:
    values = np.asarray(values, np.float64)
    known = values[~np.isnan(values)]
    return float(known.mean()) if known.size else float("nan")


def _capped(decibels: jax.Array) -> jax.Array:
    return jnp.minimum(decibels, BEST_PSNR)


def _psnr_within(shown: jax.Array, truth: jax.Array, weights: jax.Array) -> float:
    """PSNR over all pixels (n, h, w) as if they were one picture's."""
    rows = (x.reshape(1, -1, 3) for x in (shown, truth))
    if not bool(weights.any()):
        return float("nan")
    return float(_capped(psnr(*rows, weights=jnp.broadcast_to(weights, shown.shape[:3]).reshape(1, -1))))


def _mean_within(values: jax.Array, weights: jax.Array) -> float:
    """NaN where the weights are all 0."""
    total = float(jnp.sum(weights))
    return float(jnp.sum(jnp.where(weights > 0, values * weights, 0.0))) / total if total else float("nan")


@jax.jit
def _similar(shown: jax.Array, truth: jax.Array) -> jax.Array:
    return jnp.mean(ssim_map(shown, truth), axis=-1)
