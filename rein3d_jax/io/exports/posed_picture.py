"""A pinhole picture with its pose: what data sets for other tools are made of. Its files: one picture and one mask."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rein3d_jax.io.files.atomic import write_bytes
from rein3d_jax.io.pictures.image import encode_png
from rein3d_jax.scene import Camera

IMAGES, MASKS = "images", "masks"


@dataclass(frozen=True)
class PosedPicture:
    """A picture, which of its pixels hold anything, and the camera that took it."""

    name: str  # a file name without its suffix
    rgb: np.ndarray  # (h, w, 3) sRGB
    known: np.ndarray  # (h, w) bool
    distance: np.ndarray  # (h, w) metres along the ray, 0 where unknown
    camera: Camera  # pinhole

    @property
    def pose(self) -> np.ndarray:
        """world_from_camera (4, 4), OpenCV axes, float64."""
        return np.asarray(self.camera.world_from_camera, np.float64)


def write_posed_picture(folder: Path, picture: PosedPicture, mask_suffix: str) -> str:
    """Writes images/NAME.png and masks/NAME`mask_suffix` (white: use, black: leave out); returns NAME.png."""
    name = f"{picture.name}.png"
    white = np.repeat(picture.known[..., None], 3, axis=-1).astype(np.float32)
    write_bytes(folder / IMAGES / name, encode_png(picture.rgb))
    write_bytes(folder / MASKS / f"{picture.name}{mask_suffix}", encode_png(white))
    return name
