"""The held-out pictures of a room: each with its camera, and what the input panorama knows of each of its pixels."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np

from experiments.evaluate.room import EvaluationRoom
from experiments.reconstruct.quality import AT_ORIGIN, is_novel
from rein3d_jax.errors import InputError
from rein3d_jax.evaluate.inverse_distance import sample_inverse_distance
from rein3d_jax.evaluate.regions import regions_of_view
from rein3d_jax.geometry.pinhole import pinhole_rays
from rein3d_jax.geometry.poses import equirectangular_camera
from rein3d_jax.geometry.sphere import rays_of_pose, world_from_panorama
from rein3d_jax.io.rooms.posed_panorama import PosedPanorama
from rein3d_jax.io.rooms.traced_room import View
from rein3d_jax.scene import Camera

_UNKNOWN = -1  # the region of a pixel whose true distance the room does not tell


@dataclass(frozen=True)
class HeldOutPicture:
    """A picture that methods are measured against."""

    kind: Literal["origin", "view", "panorama"]  # origin: a view from the input's own place
    rgb: jax.Array  # (h, w, 3) sRGB
    camera: Camera
    distance: jax.Array | None  # (h, w) true metres, 0 where unknown; None where nothing is known
    region: jax.Array  # (h, w) evaluate.regions' codes, or _UNKNOWN

    @property
    def metres(self) -> float:
        """From the input to the camera."""
        return float(jnp.linalg.norm(self.camera.world_from_camera[:3, 3]))


@lru_cache(maxsize=1)  # every method of a room asks for them
def held_out_pictures(room: EvaluationRoom) -> list[HeldOutPicture]:
    """All views and panoramas of a room. Raises InputError if it has neither."""
    traced = room.traced
    if not traced.panos and not any(map(is_novel, traced.views)):
        raise InputError(f"{room.source.truth} has no views or panos from elsewhere: novel-views needs them")
    return [*(_view(room, view) for view in traced.views), *(_panorama(room, pano) for pano in traced.panos)]


def _view(room: EvaluationRoom, view: View) -> HeldOutPicture:
    """A view's true distance is that of the panorama at the same place, where the room has one."""
    position = np.asarray(view.camera.world_from_camera)[:3, 3]
    places = [
        pano for pano in room.traced.panos if np.linalg.norm(pano.world_from_camera[:3, 3] - position) < AT_ORIGIN
    ]
    kind = "view" if is_novel(view) else "origin"
    if kind == "origin" or not places:
        unknown = jnp.full(view.rgb.shape[:2], _UNKNOWN)
        return HeldOutPicture(kind, jnp.asarray(view.rgb), view.camera, None, unknown)
    rays = _pinhole_rays(view.camera)
    distance = _distance_at(places[0], rays)
    region = _region(room, view.camera, rays, distance)
    return HeldOutPicture(kind, jnp.asarray(view.rgb), view.camera, distance, region)


def _panorama(room: EvaluationRoom, pano: PosedPanorama) -> HeldOutPicture:
    rgb, pose = pano.panorama.rgb, jnp.asarray(pano.world_from_camera, jnp.float32)
    camera = equirectangular_camera(pose, len(rgb))
    distance = jnp.where(pano.panorama.valid, pano.panorama.distance, 0.0)
    region = _region(room, camera, rays_of_pose(pose, *distance.shape), distance)
    return HeldOutPicture("panorama", rgb, camera, distance, region)


def _region(room: EvaluationRoom, camera: Camera, rays: jax.Array, distance: jax.Array) -> jax.Array:
    return regions_of_view(room.panorama, camera.world_from_camera[:3, 3], rays, distance)


def _pinhole_rays(camera: Camera) -> jax.Array:
    """(h, w, 3) unit rays in the world."""
    rays = pinhole_rays(camera.height, camera.width, camera.focal, camera.centre)
    rays = rays / jnp.linalg.norm(rays, axis=-1, keepdims=True)
    return jnp.matmul(rays, camera.world_from_camera[:3, :3].T, precision=jax.lax.Precision.HIGHEST)


def _distance_at(pano: PosedPanorama, rays: jax.Array) -> jax.Array:
    """The panorama's distance along world rays, 0 where unknown. Interpolated in inverse distance, which is right on
    planes: the nearest pixel's is 7 % off on a floor seen at 10 degrees, far beyond what tells regions apart."""
    rotation = world_from_panorama(jnp.asarray(pano.world_from_camera, jnp.float32))
    local = jnp.matmul(rays, rotation, precision=jax.lax.Precision.HIGHEST)
    inverse, known = sample_inverse_distance(jnp.where(pano.panorama.valid, pano.panorama.distance, 0.0), local)
    return jnp.where(known, 1 / jnp.where(known, inverse, 1.0), 0.0)
