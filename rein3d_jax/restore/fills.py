"""OpenCV's inpainting, frame by frame, and no fill at all.

They use no depth: colour and distance are inpainted alike, from all sides of a hole. The only wrap they
get is a margin of the picture's other edge.
"""

import cv2
import jax.numpy as jnp
import numpy as np

from rein3d_jax.geometry.resample import pad_sphere
from rein3d_jax.scene import Video

_RADIUS = 3  # pixels, the value of OpenCV's own examples
_MARGIN = 16  # pixels of the other edge shown on each side, so that the seam is not a border


def restore_none(video: Video, *, observed: float, background=None) -> Video:
    """The video as it is, with its holes."""
    return video


def restore_telea(video: Video, *, observed: float, background=None) -> Video:
    """Inpainting by fast marching from the hole's rim (Telea 2004)."""
    return _inpaint(video, observed, cv2.INPAINT_TELEA)


def restore_navier_stokes(video: Video, *, observed: float, background=None) -> Video:
    """Inpainting that carries isophotes into the hole (Bertalmio et al. 2001)."""
    return _inpaint(video, observed, cv2.INPAINT_NS)


def _inpaint(video: Video, observed: float, method: int) -> Video:
    holes = np.asarray(video.alpha < observed)
    given = (np.asarray(video.rgb), np.asarray(video.distance), holes)  # JAX would compile for each hole's size
    frames = [_inpaint_frame(*frame, method) for frame in zip(*given, strict=True)]
    rgb, distance = (jnp.stack(list(part)) for part in zip(*frames, strict=True))
    return video.replace(rgb=rgb, distance=distance)


def _inpaint_frame(rgb, distance, hole, method):
    padded = [np.asarray(pad_sphere(jnp.asarray(x), _MARGIN)) for x in (rgb, distance, hole)]
    mask = padded[2].astype(np.uint8)
    colour = cv2.inpaint((np.clip(padded[0], 0, 1) * 255).round().astype(np.uint8), mask, _RADIUS, method) / 255.0
    # 16 bit, because the float path of OpenCV 5 leaves a checkered pattern of wrong values in Telea holes.
    unit = max(float(padded[1].max()), 1e-6) / 65535
    depth = cv2.inpaint((padded[1] / unit).round().astype(np.uint16), mask, _RADIUS, method) * unit
    inner = (slice(_MARGIN, -_MARGIN), slice(_MARGIN, -_MARGIN))
    rgb = np.where(hole[..., None], colour[inner], rgb).astype(np.float32)
    # Fast marching extrapolates slopes and may leave the range of what it read.
    low, high = distance[~hole].min(initial=np.inf), distance[~hole].max(initial=0.0)
    guess = np.clip(depth[inner], min(low, high), high)
    return rgb, np.where(hole, guess, distance).astype(np.float32)
