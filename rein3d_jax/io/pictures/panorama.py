"""A panorama from its files: the picture, and its distance where there is one."""

from pathlib import Path

import jax.numpy as jnp
import numpy as np

from rein3d_jax.geometry.push_pull import push_pull
from rein3d_jax.io.pictures.distance import read_distance
from rein3d_jax.io.pictures.image import picked, resize_colour
from rein3d_jax.io.pictures.photo import Photo, read_photo
from rein3d_jax.scene import Panorama


def read_panorama(picture: str | Path, *, distance: str | Path | None = None, height: int | None = None) -> Panorama:
    """The panorama (h, 2 h) in the file `picture`, brought to `height` rows if that is given; without `distance`, a
    file of metres along each ray (of any size; the nearest value is taken), none of its pixels is valid. Raises
    InputError for whatever `read_photo` and `read_distance` refuse."""
    photo = read_photo(picture)
    rows = len(photo.rgb) if height is None else height
    metres, valid = np.zeros((rows, 2 * rows), np.float32), np.zeros((rows, 2 * rows), bool)
    if distance is not None:
        metres, valid = (picked(x, rows) for x in read_distance(distance))
    return Panorama(*map(jnp.asarray, (whole_colours(photo, rows), metres, valid)))


def whole_colours(photo: Photo, height: int) -> np.ndarray:
    """The photo (height, 2 height, 3); what it did not see takes the colours around it."""
    if photo.seen.all():
        return resize_colour(photo.rgb, height)
    with_share = np.concatenate([photo.rgb, photo.seen[..., None].astype(np.float32)], axis=-1)
    small = resize_colour(with_share, height)
    share = small[..., 3]
    known = share > 0.5
    rgb = np.where(known[..., None], small[..., :3] / np.maximum(share, 0.5)[..., None], 0)
    return np.where(known[..., None], rgb, push_pull(jnp.asarray(rgb), jnp.asarray(known, jnp.float32)))
