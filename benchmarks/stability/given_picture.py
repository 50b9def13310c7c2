"""Regimes of the picture where the distance is good: noise, JPEG, its size."""

from dataclasses import replace
from functools import cache

import cv2
import jax.numpy as jnp
import numpy as np

from benchmarks.stability.case import drawn_room, panorama_at
from benchmarks.stability.given_distance import compare, furnished, spoiled_by
from benchmarks.stability.regime import SEEN, WHOLE, Figures, Regime
from rein3d_jax.scene import Panorama


def grainy(panorama: Panorama, levels: float, rng: np.random.Generator) -> Panorama:
    """The picture with noise of a deviation in levels of 255."""
    noise = rng.normal(scale=levels / 255, size=panorama.rgb.shape)
    return replace(panorama, rgb=jnp.asarray(np.clip(panorama.rgb + noise, 0, 1), jnp.float32))


def as_jpeg(panorama: Panorama, quality: float, _) -> Panorama:
    """The picture as a JPEG of a quality gives it back."""
    levels = (np.asarray(panorama.rgb)[..., ::-1] * 255).round().astype(np.uint8)
    _, coded = cv2.imencode(".jpg", levels, [cv2.IMWRITE_JPEG_QUALITY, int(quality)])
    read = cv2.imdecode(coded, cv2.IMREAD_COLOR)[..., ::-1] / 255
    return replace(panorama, rgb=jnp.asarray(read, jnp.float32))


@cache
def seen_at_rows(rows: float, seed: int) -> dict[str, Figures]:
    """A picture of `rows` rows."""
    case = furnished(seed)
    return compare(replace(case, given=panorama_at(drawn_room(seed), rows=int(rows))))


REGIMES = (
    Regime("grain of the picture", "grain that swims", "deviation, levels of 255", (0, 5, 10, 20, 40), 0, SEEN,
           spoiled_by(grainy)),
    Regime("JPEG", "blocks on walls", "quality", (5, 10, 30, 60, 95), 95, SEEN, spoiled_by(as_jpeg)),
    Regime("rows of the picture", "soft walls, or gaps", "rows, seen at 64", (16, 32, 64, 128, 256, 512), 64, WHOLE,
           seen_at_rows, seeds=2),
)  # fmt: skip
