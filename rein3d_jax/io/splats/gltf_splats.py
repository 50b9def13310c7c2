"""Scenes as glTF 2.0 with KHR_gaussian_splatting (Khronos, release candidate of July 2026), in one GLB file.

A mesh primitive of points: POSITION, KHR_gaussian_splatting:ROTATION (xyzw), SCALE (metres), OPACITY (in [0, 1]) and
SH_DEGREE_l_COEF_n, kernel "ellipse", colours display-referred sRGB. COLOR_0 (linear) is for viewers of points.
glTF has Y up. The data themselves are rotated, as the specification advises writers: a node's rotation would keep them
untouched, but readers only SHOULD rotate spherical harmonics by it, and some do not.
"""

import json
import struct
from pathlib import Path

import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.geometry.colour import linear_from_srgb
from rein3d_jax.geometry.spherical_harmonics import C0
from rein3d_jax.io.files.atomic import write_bytes
from rein3d_jax.io.pictures.image import to_uint8
from rein3d_jax.io.splats.gaussian_columns import FLATTEST, Columns, alive_columns
from rein3d_jax.io.splats.up_axis import with_up
from rein3d_jax.scene import Gaussians

_EXTENSION = "KHR_gaussian_splatting"
_DEGREES = {1: 0, 4: 1, 9: 2, 16: 3}  # by coefficients
_FLOAT, _BYTE = 5126, 5121  # component types
_ARRAY_BUFFER, _POINTS = 34962, 0
_SHAPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}


def write_gltf_splats(path: str | Path, gaussians: Gaussians) -> None:
    """Writes the alive slots, Y up, as a GLB, atomically. Raises InputError, and writes nothing, if a value is not
    finite or nothing is alive: glTF has no empty arrays."""
    columns = alive_columns(with_up(gaussians, "y"), path)
    if not len(columns.means):
        raise InputError(f"{path}: the scene is empty, which glTF cannot hold: write a PLY")
    write_bytes(path, _glb(_attributes(columns)))


def _attributes(c: Columns) -> dict[str, np.ndarray]:
    """Accessors by semantic, float32 (n, width) or uint8 (n, 4)."""
    opacity = 0.5 + 0.5 * np.tanh(0.5 * c.opacity_logits[:, None].astype(np.float64))
    rgb = linear_from_srgb(np.clip(0.5 + C0 * c.sh[:, 0], 0, 1))
    named = {
        "POSITION": c.means,
        "COLOR_0": to_uint8(np.hstack([rgb, opacity])),
        f"{_EXTENSION}:ROTATION": np.roll(c.quats, -1, axis=1),
        f"{_EXTENSION}:SCALE": np.exp(np.maximum(c.log_scales, FLATTEST)),
        f"{_EXTENSION}:OPACITY": opacity,
    }
    for degree in range(_DEGREES[c.sh.shape[1]] + 1):
        for order in range(2 * degree + 1):
            named[f"{_EXTENSION}:SH_DEGREE_{degree}_COEF_{order}"] = c.sh[:, degree**2 + order]
    return {name: array if array.dtype == np.uint8 else array.astype("<f4") for name, array in named.items()}


def _glb(attributes: dict[str, np.ndarray]) -> bytes:
    parts = [array.tobytes() for array in attributes.values()]
    ends = np.cumsum([len(part) for part in parts])  # each a multiple of 4, as glTF wants
    views = [
        {"buffer": 0, "byteOffset": int(end) - len(part), "byteLength": len(part), "target": _ARRAY_BUFFER}
        for part, end in zip(parts, ends, strict=True)
    ]
    accessors = [_accessor(index, array) for index, array in enumerate(attributes.values())]
    positions = attributes["POSITION"]
    accessors[0] |= {"min": positions.min(axis=0).tolist(), "max": positions.max(axis=0).tolist()}
    header = {
        "asset": {"version": "2.0", "generator": "rein3d_jax"},
        "extensionsUsed": [_EXTENSION],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "splats", "mesh": 0}],
        "meshes": [{"primitives": [_primitive(list(attributes))]}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": int(ends[-1])}],
    }
    return glb_file(header, b"".join(parts))


def _primitive(names: list[str]) -> dict:
    kernel = {"kernel": "ellipse", "colorSpace": "srgb_rec709_display"}
    how = {"projection": "perspective", "sortingMethod": "cameraDistance"}
    attributes = {name: index for index, name in enumerate(names)}
    return {"attributes": attributes, "mode": _POINTS, "extensions": {_EXTENSION: kernel | how}}


def _accessor(view: int, array: np.ndarray) -> dict:
    kind = {"componentType": _BYTE, "normalized": True} if array.dtype == np.uint8 else {"componentType": _FLOAT}
    return {"bufferView": view, "count": len(array), "type": _SHAPES[array.shape[1]]} | kind


def glb_file(header: dict, binary: bytes) -> bytes:
    """The GLB of a glTF `header` and its one buffer, whose length is a multiple of 4."""
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = [(text, b"JSON"), (binary, b"BIN\0")]
    body = b"".join(struct.pack("<I4s", len(data), kind) + data for data, kind in chunks)
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body
