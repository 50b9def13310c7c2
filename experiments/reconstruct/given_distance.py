"""A distance map from a file as metres along the ray: converted by what its numbers are, scaled by the camera's
height where they have no unit. Whatever was done is told, and a map that no room has is refused."""

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from rein3d_jax.depth.kinds import along_ray
from rein3d_jax.depth.plausible import flattest_kind, implausible_size
from rein3d_jax.depth.scale import height_above_floor
from rein3d_jax.errors import InputError
from rein3d_jax.scene import Panorama
from rein3d_jax.upsample import distance_for

_MEANS = {
    "z": "planar z of six cube faces",
    "disparity": "inverse distance, up to a factor",
    "relative": "distance up to a factor",
}


def given_distance(
    rgb: jax.Array, numbers: tuple[np.ndarray, np.ndarray], path: Path, kind: str
) -> tuple[Panorama, str]:
    """The panorama of a picture (h, 2 h, 3) and the `numbers` of a `kind` that stand in a file, with the mask of what
    is known: distances along rays (up to a factor, unless the kind is metric), and what was done to them, in words.
    Raises InputError for a map of the kind "distance" with the surfaces of another."""
    (values, valid), told = numbers, []
    if len(values) != len(rgb):
        told.append("the map is {}x{}, brought to {}x{}".format(*values.shape[::-1], *rgb.shape[1::-1]))
    if path.suffix.lower() == ".png":
        told.append("its whole numbers are taken for millimetres, or for input.distance_unit")
    if kind != "distance":
        told.append(f"taken for {_MEANS[kind]}")
    placed = along_ray(Panorama(rgb, values, valid), kind)
    distance = distance_for(rgb, jnp.where(valid, jnp.asarray(placed.distance), 0.0))
    panorama = Panorama(rgb, distance, distance > 0)
    if kind == "distance":
        found = flattest_kind(panorama, ("distance", "z", "disparity"))
        if found != kind:
            raise InputError(
                f"{path} is no distance along the ray: its surfaces are flat if it is {_MEANS[found]}; "
                f"set input.distance_kind = {found}"
            )
    return panorama, "; ".join(told)


def in_metres(panorama: Panorama, path: Path, camera_height: float | None) -> tuple[Panorama, str]:
    """The panorama of `given_distance`, level by now, in metres: multiplied so that its floor lies `camera_height`
    metres below the camera, or as it is for None; and what was done, in words. Raises InputError for a map without a
    floor to scale by, and for a room of a size that none has."""
    told, factor = "", 1.0
    if camera_height is not None:
        try:
            factor = camera_height / height_above_floor(panorama)
        except InputError as error:
            raise InputError(f"{path}: {error}") from error
        panorama = panorama.replace(distance=panorama.distance * factor)
        told = f"multiplied by {factor:.4g}, so that the floor lies {camera_height} m below the camera"
    if wrong := implausible_size(panorama):
        other = (
            "set input.distance_unit to the metres of one of its units (Matterport3D: 0.00025, Stanford 2D-3D-S: "
            "0.001953125), or input.distance_kind = relative and input.camera_height"
        )
        mend = other if camera_height is None else "check input.camera_height, in metres"
        raise InputError(f"{path} has {wrong}; {mend}")
    return panorama, told
