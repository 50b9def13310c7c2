"""Numbers in a few bits, as splat files store them: rounded to the nearest of 2^bits levels."""

import numpy as np


def to_levels(unit: np.ndarray, bits: int) -> np.ndarray:
    """Levels, uint32 in [0, 2^bits - 1], of [0, 1] of any shape, clipped; off by at most half a level."""
    top = (1 << bits) - 1
    return np.floor(np.clip(unit, 0, 1) * np.float64(top) + 0.5).astype(np.uint32)


def from_levels(levels: np.ndarray, bits: int) -> np.ndarray:
    """Inverse of to_levels, float64, of the low `bits` of each level; higher ones are another number's."""
    top = (1 << bits) - 1
    return (levels & top) / top


def alpha_bytes(logits: np.ndarray) -> np.ndarray:
    """Opacity as uint8 (...) of opacity logits (...)."""
    return to_levels(0.5 + 0.5 * np.tanh(0.5 * logits.astype(np.float64)), 8).astype(np.uint8)


def alpha_logits(alphas: np.ndarray) -> np.ndarray:
    """Opacity logits, float32, of uint8 (...). 0 and 255 stand for a quarter level from the end: logits are finite."""
    alpha = np.clip(alphas.astype(np.float64), 0.25, 254.75) / 255
    return np.log(alpha / (1 - alpha)).astype(np.float32)


def without_largest(quats: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Three components (n, 3) of quaternions (n, 4), in their order, and the place (n,) of the largest, which is left
    out and made positive: the same rotations."""
    largest = np.abs(quats).argmax(axis=1)
    signed = quats * np.where(np.take_along_axis(quats, largest[:, None], axis=1) < 0, -1, 1)
    place = np.arange(3) + (np.arange(3) >= largest[:, None])
    return np.take_along_axis(signed, place, axis=1), largest


def with_largest(others: np.ndarray, largest: np.ndarray) -> np.ndarray:
    """Unit quaternions (n, 4) of what without_largest gives: others (n, 3), and the place (n,) of the largest."""
    last = np.sqrt(np.maximum(0, 1 - (others**2).sum(axis=1, keepdims=True)))
    place = np.arange(4)
    source = np.where(place == largest[:, None], 3, place - (place > largest[:, None]))
    return np.take_along_axis(np.hstack([others, last]), source, axis=1)
