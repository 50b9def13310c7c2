"""What a map's numbers may be, and the distance along the ray from them.

distance   metres along each ray
z          metres along the axis of the cube's face that a ray goes through: depth of six perspective pictures, rendered
           or estimated, set together as one equirectangular map. The cube stands square in the panorama, its front face
           around the centre column: z = distance max(|x|, |y|, |z|) of the unit ray
disparity  inverse distance, up to a factor: largest where nearest. One that was normalised to begin at 0 has lost a
           constant too, which nothing here brings back: far walls then bend away
relative   distance along each ray, up to a factor
"""

import numpy as np

from rein3d_jax.geometry.sphere import pixel_rays64
from rein3d_jax.scene import Panorama

DISTANCE_KINDS = ("distance", "z", "disparity", "relative")
METRIC_KINDS = ("distance", "z")  # the others need a scale


def along_ray(panorama: Panorama, kind: str) -> Panorama:
    """The panorama (h, 2 h) with distances along the ray, of one whose `distance` holds numbers of a `kind`: in
    metres if that is one of METRIC_KINDS, else up to a factor."""
    if kind == "z":
        axis = np.max(np.abs(pixel_rays64(len(panorama.distance))), axis=-1)
        return panorama.replace(distance=panorama.distance / axis)
    if kind == "disparity":
        known = np.where(panorama.valid, panorama.distance, 1)
        return panorama.replace(distance=np.where(panorama.valid, 1 / known, 0))
    return panorama
