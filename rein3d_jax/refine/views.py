"""Panoramas -> the perspective views that the scene is fitted to (paper Sec. 3.3)."""

import math

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.conventions import EQUIRECTANGULAR, PINHOLE
from rein3d_jax.geometry.pinhole import focal_from_fov
from rein3d_jax.geometry.poses import rigid
from rein3d_jax.geometry.resample import perspective_crop
from rein3d_jax.geometry.sphere import latitudes
from rein3d_jax.refine.config import RefineConfig
from rein3d_jax.scene import Camera

# Yaw (turning right) and pitch (up) of the six views, in quarter turns.
FACES = ((0, 0), (1, 0), (2, 0), (3, 0), (0, 1), (0, -1))

SAME_SURFACE = 0.01  # relative; beside a step of 20 % in distance the two means differ by 3 %


@struct.dataclass
class Views:
    """m square pinhole views (w = s), or panoramas (w = 2 s)."""

    rgb: jax.Array  # (m, s, w, 3) sRGB
    weight: jax.Array  # (m, s, w) trust in each pixel, 0 where nothing is known
    distance: jax.Array  # (m, s, w) metres along the ray, 0 where it is not to be fitted
    world_from_camera: jax.Array  # (m, 4, 4)
    focal: jax.Array  # (m,) pixels; of no meaning for panoramas
    source: jax.Array  # (m,) int32: 0 the input, i the i-th trajectory


def camera_of(views: Views, index: int | jax.Array) -> Camera:
    """The camera of view `index`."""
    height, width = views.rgb.shape[1:3]
    model = PINHOLE if width == height else EQUIRECTANGULAR
    focal = jnp.full(2, views.focal[index])
    return Camera(views.world_from_camera[index], focal, jnp.array([width / 2, height / 2]), model, width, height)


def join_views(*parts: Views) -> Views:
    """All views of `parts`, one after another."""
    return jax.tree.map(lambda *x: jnp.concatenate(x), *parts)


def _turn(yaw: float, pitch: float) -> jax.Array:
    """(3, 3) panorama_from_camera in OpenCV axes: yaw to the right about +y (down), then pitch up about +x."""
    cy, sy, cp, sp = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch)
    about_down = jnp.array([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]])
    about_right = jnp.array([[1.0, 0.0, 0.0], [0.0, cp, -sp], [0.0, sp, cp]])
    return about_down @ about_right


def views_from_panorama(
    rgb: jax.Array,
    weight: jax.Array,
    distance: jax.Array,
    world_from_camera: jax.Array,
    *,
    source: int,
    turn: float,
    config: RefineConfig,
) -> Views:
    """Panorama (h, w, 3), weight and distance (h, w), its pose (4, 4) -> six views of `fov` degrees, the first ones
    `turn` radians to the right of its centre column: neighbouring panoramas cut at different places leave no common
    seam. With `config.panoramic` the panorama itself, of `crop` rows, weighed by its pixels' solid angles."""
    image = jnp.concatenate([rgb, jnp.stack([weight, *_inverse_and_own(distance)], axis=-1)], axis=-1)
    if config.panoramic:
        pictures, poses, focal = _whole(image, config.crop)[None], world_from_camera[None], 0.0
    else:
        focal = focal_from_fov(math.radians(config.fov), config.crop)
        turns = jnp.stack([_turn(turn + yaw * math.pi / 2, pitch * math.pi / 2) for yaw, pitch in FACES])
        rotations = jnp.matmul(world_from_camera[:3, :3], turns, precision="highest")
        poses = rigid(rotations, jnp.broadcast_to(world_from_camera[:3, 3], (len(FACES), 3)))
        pictures = _crops(image, world_from_camera, poses, focal, config.crop)
    count = len(poses)
    return Views(
        pictures[..., :3], pictures[..., 3], _one_surface(*jnp.moveaxis(pictures[..., 4:], -1, 0)), poses,
        jnp.full(count, focal, jnp.float32), jnp.full(count, source, jnp.int32),
    )  # fmt: skip


def _inverse_and_own(distance):
    return jnp.where(distance > 0, 1 / jnp.where(distance > 0, distance, 1.0), 0.0), distance


def _one_surface(inverse, distance):
    """Metres where the pixels averaged lay on one surface, else 0: the means of d and of 1/d agree there only."""
    same = jnp.abs(inverse * distance - 1) < SAME_SURFACE
    return jnp.where(same, distance, 0.0)


def _whole(image, height):
    """The panorama at `height` rows, its weights (channel 3) times the cosine of the latitude, whose mean is made 1."""
    image = jax.image.resize(image, (height, 2 * height, image.shape[-1]), "linear")
    area = jnp.cos(latitudes(height))
    return image.at[..., 3].multiply((area / jnp.mean(area))[:, None])


def _crops(image, world_from_panorama, poses, focal, size):
    centre = jnp.full(2, size / 2)

    def crop(pose):
        camera = Camera(pose, jnp.full(2, focal), centre, PINHOLE, size, size)
        return perspective_crop(image, world_from_panorama, camera)

    return jax.lax.map(crop, poses)


_crops = jax.jit(_crops, static_argnames=("size",))
