"""Distance as colour: near is dark violet, far is yellow (viridis at nine points), unknown is grey."""

import numpy as np

VIRIDIS = np.array(
    [
        [0x44, 0x01, 0x54],
        [0x47, 0x2D, 0x7B],
        [0x3B, 0x52, 0x8B],
        [0x2C, 0x72, 0x8E],
        [0x21, 0x90, 0x8C],
        [0x28, 0xAE, 0x80],
        [0x5D, 0xC9, 0x63],
        [0xAB, 0xDC, 0x32],
        [0xFD, 0xE7, 0x25],
    ]
)
_UNKNOWN = 0.75  # grey


def colour_range(distance: np.ndarray, valid: np.ndarray) -> tuple[float, float]:
    """Metres (near, far) that hold all known distances but the outer 1 % at each end; (0, 1) where none is known."""
    known = np.asarray(distance)[np.asarray(valid, bool)]
    if not known.size:
        return 0.0, 1.0
    near, far = np.percentile(known, [1, 99])
    return float(near), float(far)


def colour_map(distance: np.ndarray, valid: np.ndarray, near: float, far: float) -> np.ndarray:
    """Colours (..., 3), float32 sRGB in [0, 1], of `distance` (...) metres, clipped to near and far."""
    valid = np.asarray(valid, bool)
    share = (np.where(valid, distance, near) - near) / max(far - near, np.finfo(np.float32).eps)
    stops = np.linspace(0, 1, len(VIRIDIS))
    rgb = np.stack([np.interp(share, stops, channel) for channel in VIRIDIS.T / 255], axis=-1)
    return np.where(valid[..., None], rgb, _UNKNOWN).astype(np.float32)
