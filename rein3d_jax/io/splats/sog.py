"""Scenes as SOG, PlayCanvas's format for the web (version 2): lossless WebP textures and meta.json in one ZIP, about 7
bytes a Gaussian. SuperSplat, PlayCanvas, Spark and splat-transform read it.

means_l, means_u   16 bits of sign(x) log(1 + |x|) in the scene's bounds, low and high bytes
quats              three components in steps of sqrt(2) / 255; alpha 252 + which of wxyz, the largest, is left out
scales             indices into a codebook of log scales
sh0                indices into a codebook of f_dc; alpha the opacity
shN_labels         16 bits, a Gaussian's entry in a palette; shN_centroids: its coefficients, by a codebook

The axes are those of PLY: viewers turn both by half a turn about Z. Source: developer.playcanvas.com, "The SOG format".
"""

import io
import json
import math
import zipfile
from pathlib import Path

import cv2
import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import write_bytes
from rein3d_jax.io.splats.codebook import scalar_codebook, vector_palette
from rein3d_jax.io.splats.compressed_ply import morton_order
from rein3d_jax.io.splats.gaussian_columns import Columns, alive_columns
from rein3d_jax.io.splats.quantise import alpha_bytes, to_levels, without_largest
from rein3d_jax.scene import Gaussians

_LOSSLESS = 101  # OpenCV's quality of a WebP
_BANDS = {4: 1, 9: 2, 16: 3}  # degree, by coefficients
_PALETTE = 4096  # entries at most: 14 s for 100,000 Gaussians of degree 3; the format holds 65,536
_ACROSS = 64  # entries in a row of shN_centroids
_DATE = (1980, 1, 1, 0, 0, 0)  # or the time of writing goes in


def write_sog(path: str | Path, gaussians: Gaussians, *, antialias: bool = False) -> None:
    """Writes the alive slots, atomically; `antialias` is write_ply's. The order of the Gaussians changes. Raises
    InputError, and writes nothing, if a value is not finite or nothing is alive."""
    columns = alive_columns(gaussians, path)
    if not len(columns.means):
        raise InputError(f"{path}: the scene is empty, which SOG cannot hold: write a PLY")
    order = morton_order(columns.means)
    meta, textures = _packed(Columns(*(field[order] for field in columns)))
    meta |= {"model": "antialiased"} if antialias else {}
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, texture in textures.items():
            archive.writestr(zipfile.ZipInfo(name, _DATE), _webp(texture))
        archive.writestr(zipfile.ZipInfo("meta.json", _DATE), json.dumps(meta))
    write_bytes(path, buffer.getvalue())


def _packed(c: Columns) -> tuple[dict, dict[str, np.ndarray]]:
    """meta.json, and the textures (h, w, 4) uint8 by name."""
    count = len(c.means)
    logs = np.sign(c.means) * np.log1p(np.abs(c.means.astype(np.float64)))
    low, high = logs.min(axis=0), logs.max(axis=0)
    places = to_levels((logs - low) / np.maximum(high - low, 1e-9), 16)
    scales, scale_labels = scalar_codebook(c.log_scales)
    colours, colour_labels = scalar_codebook(c.sh[:, 0])
    meta = {
        "version": 2,
        "asset": {"generator": "rein3d_jax"},
        "count": count,
        "means": {"mins": low.tolist(), "maxs": high.tolist(), "files": ["means_l.webp", "means_u.webp"]},
        "scales": {"codebook": scales.tolist(), "files": ["scales.webp"]},
        "quats": {"files": ["quats.webp"]},
        "sh0": {"codebook": colours.tolist(), "files": ["sh0.webp"]},
    }
    textures = {
        "means_l.webp": _texture(places & 255),
        "means_u.webp": _texture(places >> 8),
        "quats.webp": _texture(*_smallest(c.quats)),
        "scales.webp": _texture(scale_labels),
        "sh0.webp": _texture(colour_labels, alpha_bytes(c.opacity_logits)),
    }
    if c.sh.shape[1] > 1:
        higher, centroids, labels = _higher(c.sh[:, 1:])
        meta["shN"] = higher | {"bands": _BANDS[c.sh.shape[1]]}
        textures |= {"shN_centroids.webp": centroids, "shN_labels.webp": _texture(labels)}
    return meta, textures


def _higher(sh: np.ndarray) -> tuple[dict, np.ndarray, np.ndarray]:
    """What meta.json says of coefficients (n, k, 3) above degree 0, their palette's texture, and labels (n, 3)."""
    count, coefficients = sh.shape[:2]
    palette, labels = vector_palette(sh.reshape(count, -1), _PALETTE)
    book, indices = scalar_codebook(palette)
    rows = -(-len(palette) // _ACROSS)
    texels = np.zeros((rows * _ACROSS, coefficients, 4), np.uint8)
    texels[: len(palette), :, :3] = indices.reshape(len(palette), coefficients, 3)
    texels[..., 3] = 255
    told = {"count": len(palette), "codebook": book.tolist(), "files": ["shN_centroids.webp", "shN_labels.webp"]}
    return told, texels.reshape(rows, _ACROSS * coefficients, 4), np.stack([labels & 255, labels >> 8, 0 * labels], 1)


def _smallest(quats: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    others, largest = without_largest(quats)
    return to_levels(0.5 + math.sqrt(0.5) * others, 8), 252 + largest


def _texture(rgb: np.ndarray, alpha: np.ndarray | int = 255) -> np.ndarray:
    """(n, 3) and (n,) bytes as a texture (h, w, 4) of sides that are multiples of 4, row by row."""
    width = 4 * math.ceil(math.sqrt(len(rgb)) / 4)
    height = 4 * math.ceil(len(rgb) / width / 4)
    texels = np.zeros((height * width, 4), np.uint8)
    texels[: len(rgb), :3], texels[: len(rgb), 3] = rgb, alpha
    return texels.reshape(height, width, 4)


def _webp(texture: np.ndarray) -> bytes:
    bgra = np.ascontiguousarray(texture[..., [2, 1, 0, 3]])
    return cv2.imencode(".webp", bgra, [cv2.IMWRITE_WEBP_QUALITY, _LOSSLESS])[1].tobytes()
