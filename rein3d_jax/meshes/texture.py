"""Pictures on surfaces: each with its halvings, so that a pixel that covers many texels reads their mean."""

from dataclasses import dataclass

import cv2
import numpy as np


@dataclass(frozen=True)
class Texture:
    """A picture that repeats; (u, v) = (0, 0) is its lower left corner, as in OBJ."""

    levels: tuple[np.ndarray, ...]  # (h, w, 3) uint8 sRGB, each half the one before, down to a row or a column

    @property
    def texels(self) -> int:
        """Number of texels of the full picture."""
        return self.levels[0].shape[0] * self.levels[0].shape[1]


def texture(picture: np.ndarray) -> Texture:
    """Texture of a picture (h, w, 3), uint8 sRGB."""
    assert picture.dtype == np.uint8 and picture.shape[2:] == (3,), (picture.dtype, picture.shape)
    levels = [np.ascontiguousarray(picture)]
    while max(levels[-1].shape[:2]) > 1:
        h, w = (max(1, size // 2) for size in levels[-1].shape[:2])
        levels.append(cv2.resize(levels[-1], (w, h), interpolation=cv2.INTER_AREA))
    return Texture(tuple(levels))


def sample_texture(picture: Texture, uv: np.ndarray, level: np.ndarray) -> np.ndarray:
    """Colours (n, 3) in [0, 1] at `uv` (n, 2), read at `level` (n,) = log2 of the texels that a pixel's side covers:
    bilinear in the picture, linear between two halvings (Williams 1983)."""
    level = np.clip(level, 0, len(picture.levels) - 1)
    below = np.floor(level).astype(int)
    colour = np.empty((len(uv), 3))
    for index in np.unique(below):
        here = below == index
        share = (level[here] - index)[:, None]
        coarser = picture.levels[min(index + 1, len(picture.levels) - 1)]
        fine, coarse = (_bilinear(pixels, uv[here]) for pixels in (picture.levels[index], coarser))
        colour[here] = fine * (1 - share) + coarse * share
    return colour / 255


def _bilinear(pixels: np.ndarray, uv: np.ndarray) -> np.ndarray:
    h, w = pixels.shape[:2]
    x, y = (uv[:, 0] % 1) * w - 0.5, ((1 - uv[:, 1]) % 1) * h - 0.5
    left, top = np.floor(x).astype(int), np.floor(y).astype(int)
    right_share, bottom_share = (x - left)[:, None], (y - top)[:, None]
    columns, rows = (left % w, (left + 1) % w), (top % h, (top + 1) % h)
    upper, lower = (pixels[row, columns[0]] * (1 - right_share) + pixels[row, columns[1]] * right_share for row in rows)
    return upper * (1 - bottom_share) + lower * bottom_share
