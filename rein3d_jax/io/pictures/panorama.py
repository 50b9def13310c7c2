"""A panorama from its files: the picture, and its distance where there is one."""

from pathlib import Path

import jax.numpy as jnp
import numpy as np

from rein3d_jax.io.pictures.distance import read_distance
from rein3d_jax.io.pictures.image import read_rgb, resize_panorama
from rein3d_jax.scene import Panorama


def read_panorama(picture: str | Path, *, distance: str | Path | None = None, height: int | None = None) -> Panorama:
    """The panorama (h, 2 h) in the file `picture`, brought to `height` rows if that is given; without `distance`, a
    file of metres along each ray (of any size; the nearest value is taken), none of its pixels is valid. Raises
    InputError for whatever `read_rgb` and `read_distance` refuse."""
    rgb = read_rgb(picture)
    metres, valid = (None, None) if distance is None else read_distance(distance)
    rgb, metres, valid = resize_panorama(rgb, metres, valid, len(rgb) if height is None else height)
    if metres is None:
        metres, valid = np.zeros(rgb.shape[:2], np.float32), np.zeros(rgb.shape[:2], bool)
    return Panorama(*map(jnp.asarray, (rgb, metres, valid)))
