"""Perspective views of a run's panoramas, for other tools to train on."""

import math
from collections.abc import Iterator

import jax
import jax.numpy as jnp
import numpy as np

from experiments.run_folder import RunFolder
from rein3d_jax.geometry.poses import pinhole_camera, upright
from rein3d_jax.geometry.resample import perspective_crop
from rein3d_jax.io.exports.posed_picture import PosedPicture
from rein3d_jax.pipeline.stages import origin_pose
from rein3d_jax.scene import Camera, Panorama

_FACES = {"front": (0, 0), "left": (1, 0), "back": (2, 0), "right": (3, 0), "up": (0, 1), "down": (0, -1)}
_FOV = math.pi / 2  # six of these tile the sphere
_KNOWN = 0.999  # of what a pixel averages: masks leave out what touches the unknown


def posed_pictures(run: RunFolder) -> Iterator[PosedPicture]:
    """Pictures with their cameras: six views of the input, and of every restored frame that was taken elsewhere."""
    yield from _views("input", run.panorama, origin_pose())
    for path, video in enumerate(run.videos()):
        for index in range(1, video.rgb.shape[0]):  # frame 0 stands at the origin
            frame = Panorama(video.rgb[index], video.distance[index], video.distance[index] > 0)
            yield from _views(f"path{path}_{index:02d}", frame, video.world_from_camera[index])


def _views(name: str, panorama: Panorama, pose: jax.Array) -> Iterator[PosedPicture]:
    # As fine at its centre as the panorama is: focal length and pixels per radian agree.
    size = 2 * round(panorama.rgb.shape[1] / (2 * math.pi) * math.tan(_FOV / 2))
    cameras = {face: _camera(pose, size, *steps) for face, steps in _FACES.items()}
    for face, camera in cameras.items():
        rgb, known, distance = (np.asarray(part) for part in _crop(panorama, pose, camera))
        yield PosedPicture(f"{name}_{face}", rgb, known, distance, camera)


def _camera(pose: jax.Array, size: int, yaw: int, pitch: int) -> Camera:
    return pinhole_camera(upright(pose[:3, 3], yaw * math.pi / 2, pitch * math.pi / 2), size, _FOV)


@jax.jit
def _crop(panorama: Panorama, pose: jax.Array, camera: Camera):
    valid = panorama.valid.astype(jnp.float32)
    image = jnp.concatenate([panorama.rgb, jnp.stack([valid, panorama.distance * valid], axis=-1)], axis=-1)
    seen = perspective_crop(image, pose, camera)
    known = seen[..., 3] > _KNOWN
    return seen[..., :3], known, jnp.where(known, seen[..., 4], 0.0)
