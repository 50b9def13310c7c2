"""What a camera sees of a run's refined scene along a walk: colour, distance and normals."""

import math
from collections.abc import Iterator

import jax.numpy as jnp
import numpy as np

from experiments.export.walk import headings
from experiments.run_folder import RunFolder
from rein3d_jax.geometry.poses import pinhole_camera, upright
from rein3d_jax.geometry.rotations import matrix_from_quats
from rein3d_jax.geometry.spherical_harmonics import sh_from_rgb
from rein3d_jax.io.exports.posed_frames import PosedFrame
from rein3d_jax.rasterize import render
from rein3d_jax.scene import Camera, Gaussians

_FOV = math.pi / 2  # across the width
_SEEN = 0.5  # alpha from which a pixel has a distance


def camera_frames(run: RunFolder, places: np.ndarray, size: tuple[int, int]) -> Iterator[PosedFrame]:
    """Frames of `size` (h, w) at places (n, 2), level with the origin, facing along the walk; colour over the run's
    backdrop."""
    scene, raster, buffers = run.refined, run.config.rasterize, None
    axes = shortest_axes(scene)
    for place, yaw in zip(places, headings(places), strict=True):
        camera = pinhole_camera(upright(jnp.array([*place, 0.0]), float(yaw)), size, _FOV)
        seen, buffers = render(scene, camera, config=raster, buffers=buffers)
        facing, buffers = render(_painted(scene, axes, camera), camera, config=raster, buffers=buffers)
        alpha = seen.alpha[..., None]
        known = np.asarray(alpha > _SEEN)
        rgb = np.asarray(jnp.clip(seen.rgb + (1 - alpha) * run.backdrop, 0, 1))
        normals = 2 * np.asarray(facing.rgb) - np.asarray(facing.alpha[..., None])
        normals = normals / np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-6)
        distance = np.where(known[..., 0], np.asarray(seen.distance), 0.0)
        yield PosedFrame(rgb, distance, np.where(known, normals, 0.0), camera)


def shortest_axes(scene: Gaussians) -> jnp.ndarray:
    """Unit vectors (n, 3) across each splat, of either sign: the normals of the surfaces that splats lie on.

    On the sample room they are 0.06 to 0.17 degrees off the true normals in the median, those of the rendered
    distance's differences 3 to 8."""
    shortest = jnp.argmin(scene.log_scales, axis=1)
    return jnp.take_along_axis(matrix_from_quats(scene.quats), shortest[:, None, None], axis=2)[..., 0]


def _painted(scene: Gaussians, axes: jnp.ndarray, camera: Camera) -> Gaussians:
    """The scene with its normals towards the camera as colours: 0.5 + 0.5 n."""
    away = jnp.sum(axes * (scene.means - camera.world_from_camera[:3, 3]), axis=1, keepdims=True) > 0
    return scene.replace(sh=sh_from_rgb(0.5 + 0.5 * jnp.where(away, -axes, axes))[:, None])
