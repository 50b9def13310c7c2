"""A pair of clips as bytes, for a record file: an uncompressed npz (the record file compresses) of

clean_rgb, degraded_rgb        (t, h, w, 3) uint8
degraded_alpha                 (t, h, w) uint8
clean_distance, degraded_distance  (t, h, w) float16 metres, 0 where unknown: 0.05 % off, what training needs
world_from_camera              (t, 4, 4) float32, of both
"""

import io
import zipfile

import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.scene import Pair, Video

_FARTHEST = 65504.0  # metres: float16's largest
_MAX_BYTES = 2**31  # of one record: a paper-sized clip (41 frames, 448 x 896) takes 0.2 GB


def encode_pair(pair: Pair) -> bytes:
    """Bytes of a pair; the same pair gives the same bytes."""
    buffer = io.BytesIO()
    arrays = {
        "clean_rgb": _levels(pair.clean.rgb),
        "degraded_rgb": _levels(pair.degraded.rgb),
        "degraded_alpha": _levels(pair.degraded.alpha),
        "clean_distance": _metres(pair.clean.distance),
        "degraded_distance": _metres(pair.degraded.distance),
        "world_from_camera": np.asarray(pair.clean.world_from_camera, np.float32),
    }
    np.savez(buffer, allow_pickle=False, **arrays)
    return buffer.getvalue()


def decode_pair(data: bytes, name: str = "a record") -> Pair:
    """The pair as float32, NumPy's. Raises InputError, with `name` in it, for bytes that hold none."""
    try:
        arrays = _arrays(data)
        rgb, frames = arrays["clean_rgb"], arrays["world_from_camera"].shape[0]
        shape = (frames, *rgb.shape[1:3])
        for key, array in arrays.items():
            wanted = {"clean_rgb": (*shape, 3), "degraded_rgb": (*shape, 3), "world_from_camera": (frames, 4, 4)}
            if array.shape != wanted.get(key, shape) or array.dtype != _DTYPES[key]:
                raise ValueError(f"{key} is {array.dtype} {array.shape}")
        return _pair(**arrays)
    except (ValueError, KeyError, IndexError, OSError, zipfile.BadZipFile) as error:
        raise InputError(f"{name} holds no pair of clips ({error}): build its shard again") from error


_DTYPES = {
    "clean_rgb": np.uint8,
    "degraded_rgb": np.uint8,
    "degraded_alpha": np.uint8,
    "clean_distance": np.float16,
    "degraded_distance": np.float16,
    "world_from_camera": np.float32,
}


def _arrays(data: bytes) -> dict[str, np.ndarray]:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        size = sum(entry.file_size for entry in archive.infolist())
    if size > _MAX_BYTES:
        raise ValueError(f"{size} bytes")
    with np.load(io.BytesIO(data), allow_pickle=False) as archive:
        return {name: archive[name] for name in _DTYPES}


def _pair(clean_rgb, degraded_rgb, degraded_alpha, clean_distance, degraded_distance, world_from_camera) -> Pair:
    clean_distance, degraded_distance = (x.astype(np.float32) for x in (clean_distance, degraded_distance))
    clean_rgb, degraded_rgb, alpha = (x.astype(np.float32) / 255 for x in (clean_rgb, degraded_rgb, degraded_alpha))
    clean = Video(clean_rgb, np.ones(alpha.shape, np.float32), clean_distance, world_from_camera)
    return Pair(clean, Video(degraded_rgb, alpha, degraded_distance, world_from_camera))


def _levels(values) -> np.ndarray:
    return np.round(np.clip(np.asarray(values), 0, 1) * 255).astype(np.uint8)


def _metres(distance) -> np.ndarray:
    return np.clip(np.asarray(distance), 0, _FARTHEST).astype(np.float16)
