"""Panoramas -> the perspective views that the scene is fitted to (paper Sec. 3.3)."""

import math
from functools import partial

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.conventions import PINHOLE
from rein3d_jax.geometry.pinhole import focal_from_fov
from rein3d_jax.geometry.poses import rigid
from rein3d_jax.geometry.resample import perspective_crop
from rein3d_jax.refine.config import ViewsConfig
from rein3d_jax.scene import Camera

# Yaw (to the right) and pitch (up) of the six views, in quarters of a circle.
_FACES = ((0, 0), (1, 0), (2, 0), (3, 0), (0, 1), (0, -1))


@struct.dataclass
class Views:
    """m square pinhole views."""

    rgb: jax.Array  # (m, s, s, 3) sRGB
    weight: jax.Array  # (m, s, s) trust in each pixel, 0 where nothing is known
    world_from_camera: jax.Array  # (m, 4, 4)
    focal: jax.Array  # (m,) pixels


def camera_of(views: Views, index: int | jax.Array) -> Camera:
    """The camera of view `index`."""
    size = views.rgb.shape[1]
    focal, centre = jnp.full(2, views.focal[index]), jnp.full(2, size / 2, jnp.float32)
    return Camera(views.world_from_camera[index], focal, centre, PINHOLE, size, size)


def join_views(*parts: Views) -> Views:
    """All views of `parts`, one after another."""
    return jax.tree.map(lambda *x: jnp.concatenate(x), *parts)


def _rotation(yaw: float, pitch: float) -> jax.Array:
    """(3, 3) panorama_from_camera in OpenCV axes: yaw to the right about +y (down), then pitch up about +x."""
    cy, sy, cp, sp = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch)
    about_down = jnp.array([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]])
    about_right = jnp.array([[1.0, 0.0, 0.0], [0.0, cp, -sp], [0.0, sp, cp]])
    return about_down @ about_right


def views_from_panorama(
    rgb: jax.Array, weight: jax.Array, world_from_camera: jax.Array, *, yaw: float, config: ViewsConfig
) -> Views:
    """Six views of `fov` degrees of a panorama (h, w, 3), its weight (h, w) and pose (4, 4), the first ones `yaw`
    radians to the right of its centre column: neighbouring panoramas cut at different places leave no common seam."""
    image = jnp.concatenate([rgb, weight[..., None]], axis=-1)
    focal = focal_from_fov(math.radians(config.fov), config.size)
    rotations = jnp.stack([_rotation(yaw + quarters * math.pi / 2, pitch * math.pi / 2) for quarters, pitch in _FACES])
    rotations = jnp.matmul(world_from_camera[:3, :3], rotations, precision="highest")
    poses = rigid(rotations, jnp.broadcast_to(world_from_camera[:3, 3], (len(_FACES), 3)))
    pictures = _crops(image, world_from_camera, poses, focal, config.size)
    return Views(pictures[..., :3], pictures[..., 3], poses, jnp.full(len(_FACES), focal, jnp.float32))


@partial(jax.jit, static_argnames=("size",))
def _crops(image, world_from_panorama, poses, focal, size):
    centre = jnp.full(2, size / 2)

    def crop(pose):
        camera = Camera(pose, jnp.full(2, focal), centre, PINHOLE, size, size)
        return perspective_crop(image, world_from_panorama, camera)

    return jax.lax.map(crop, poses)
