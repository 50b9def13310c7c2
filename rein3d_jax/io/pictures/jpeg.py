"""What JPEG makes of a picture, without a file."""

import cv2
import numpy as np

from rein3d_jax.io.pictures.image import encode_jpeg


def through_jpeg(rgb: np.ndarray, quality: int) -> np.ndarray:
    """sRGB (h, w, 3) in [0, 1], float32, compressed at `quality`, 1 to 100, and decoded again."""
    pixels = cv2.imdecode(np.frombuffer(encode_jpeg(rgb, quality), np.uint8), cv2.IMREAD_COLOR)
    return pixels[..., ::-1].astype(np.float32) / 255
