"""The baseline that most simple viewers are: a mesh over the panorama's pixels, placed by distance and cut where the
distance jumps, its texture the panorama. What lies behind a cut is a hole."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from experiments.evaluate.renderer import Rendering
from rein3d_jax.conventions import EQUIRECTANGULAR
from rein3d_jax.geometry.pinhole import pinhole_rays
from rein3d_jax.geometry.resample import sample_sphere
from rein3d_jax.geometry.sphere import pixels_from_rays, rays_of_pose64
from rein3d_jax.io.rooms.posed_panorama import panorama_pose
from rein3d_jax.meshes.ray_caster import RayCaster
from rein3d_jax.scene import Camera, Panorama

_JUMP = 0.05  # change of inverse distance, as a share of the larger, beyond its surfaces' own slope, that cuts a link
_PEAK = 3  # links; a slope that goes on for as many is a surface's own, a narrower one is a jump
_SAMPLES = 2  # rays a pixel and side


@dataclass(frozen=True)
class MeshWarp:
    """A panorama's mesh, to be rendered from anywhere: a `Renderer`."""

    rgb: jax.Array  # (h, w, 3) sRGB, the texture
    caster: RayCaster
    triangles: int

    def __call__(self, camera: Camera) -> Rendering:
        """What `camera` sees, each pixel the mean of _SAMPLES^2 rays."""
        eye = np.asarray(camera.world_from_camera, np.float64)[:3, 3]
        rays = _rays(camera)
        hits = self.caster.cast(eye, rays.reshape(-1, 3))
        points = jnp.asarray(eye + rays * hits.distance.reshape(*rays.shape[:2], 1), jnp.float32)
        colour = _texture(self.rgb, points)
        hit = jnp.asarray(hits.triangle.reshape(rays.shape[:2]) >= 0, jnp.float32)
        distance = jnp.asarray(hits.distance.reshape(rays.shape[:2]), jnp.float32)
        alpha = _mean(hit)
        share = jnp.where(alpha > 0, alpha, 1.0)
        return Rendering(_mean(colour * hit[..., None]) / share[..., None], alpha, _mean(distance) / share)


def mesh_warp(panorama: Panorama) -> MeshWarp:
    """The mesh of a panorama (h, w) at the world's origin; pixels that are not valid are no vertices. Raises
    InputError without embreex."""
    distance = np.where(panorama.valid, panorama.distance, 0.0).astype(np.float64)
    corners = mesh_of(distance)
    return MeshWarp(jnp.asarray(panorama.rgb), RayCaster(corners), len(corners))


def mesh_of(distance: np.ndarray) -> np.ndarray:
    """(h, w) metres, 0 where unknown -> (n, 3, 3) corners: two triangles between four pixel centres, closed round the
    seam and by a fan at each pole; none across a cut link."""
    known = distance > 0
    inverse = np.where(known, 1 / np.where(known, distance, 1.0), 0.0)
    points = rays_of_pose64(panorama_pose(np.eye(3), np.zeros(3)), len(distance)) * distance[..., None]
    across = _links(np.concatenate([inverse, inverse[:, :1]], axis=1), "wrap")  # (i, j) to (i, j + 1)
    down = _links(inverse.T, "edge").T  # (i, j) to (i + 1, j)
    right = np.roll(points, -1, axis=1)
    upper = np.stack([points[:-1], right[:-1], points[1:]], axis=2)[across[:-1] & down]
    lower = np.stack([right[:-1], right[1:], points[1:]], axis=2)[across[1:] & np.roll(down, -1, axis=1)]
    fans = [_fan(points[row], right[row], across[row], height) for row, height in ((0, 1.0), (-1, -1.0))]
    return np.concatenate([upper, lower, *fans])


def _links(inverse: np.ndarray, beyond: str) -> np.ndarray:
    """(n, m + 1) inverse distances, 0 where unknown -> (n, m) whether a pixel and the next lie on one surface.

    Inverse distance is nearly linear in the pixel over a plane: a grazing floor is steep, but goes on, and is no jump.
    A grey opening of the slope takes jumps away and leaves what goes on; an unknown neighbour is no reason to cut."""
    one, other = inverse[:, :-1], inverse[:, 1:]
    known = (one > 0) & (other > 0)
    slope = np.pad(np.where(known, np.abs(other - one), np.inf), ((0, 0), (_PEAK - 1, _PEAK - 1)), mode=beyond)
    least = sliding_window_view(slope, _PEAK, axis=1).min(axis=-1)
    own = sliding_window_view(least, _PEAK, axis=1).max(axis=-1)
    jump = np.where(known, np.abs(other - one), 0.0) - np.where(known, own, 0.0)
    return known & (jump <= _JUMP * np.maximum(one, other))


def _fan(row: np.ndarray, right: np.ndarray, whole: np.ndarray, up: float) -> np.ndarray:
    """(n, 3, 3) triangles between a polar row's points and the pole, at their mean height: the ceiling goes on."""
    height = np.abs(row[whole, 2])
    pole = np.array([0.0, 0.0, up * (height.mean() if height.size else 0.0)])
    return np.stack([row, right, np.broadcast_to(pole, row.shape)], axis=1)[whole]


def _rays(camera: Camera) -> np.ndarray:
    """(_SAMPLES h, _SAMPLES w, 3) unit rays in the world, float64."""
    pose = np.asarray(camera.world_from_camera, np.float64)
    if camera.model == EQUIRECTANGULAR:
        return rays_of_pose64(pose, _SAMPLES * camera.height)
    size = (_SAMPLES * camera.height, _SAMPLES * camera.width)
    local = np.asarray(pinhole_rays(*size, _SAMPLES * camera.focal, _SAMPLES * camera.centre), np.float64)
    rays = local @ pose[:3, :3].T
    return rays / np.linalg.norm(rays, axis=-1, keepdims=True)


@jax.jit
def _texture(rgb: jax.Array, points: jax.Array) -> jax.Array:
    return sample_sphere(rgb, *pixels_from_rays(points, *rgb.shape[:2]))


def _mean(image: jax.Array) -> jax.Array:
    """(_SAMPLES h, _SAMPLES w, ...) -> (h, w, ...)."""
    height, width = (size // _SAMPLES for size in image.shape[:2])
    return image.reshape(height, _SAMPLES, width, _SAMPLES, *image.shape[2:]).mean(axis=(1, 3))
