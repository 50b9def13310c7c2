"""How much a video trembles: differences of neighbouring frames, as they are or after undoing the camera's motion.

Both say by what independent noise of each pixel, RMS in [0, 1], a still video would have to be disturbed to tremble as
much: the RMS difference of two frames over sqrt(2), since both carry the noise."""

import jax
import jax.numpy as jnp

from rein3d_jax.evaluate.inverse_distance import sample_inverse_distance
from rein3d_jax.geometry.resample import sample_sphere
from rein3d_jax.geometry.sphere import pixel_solid_angles, pixels_from_rays, rays_of_pose, world_from_camera_axes

VISIBLE = 0.02  # relative distance within which two frames look at the same surface


@jax.jit
def flicker(frames: jax.Array) -> jax.Array:
    """(t, h, w, c) sRGB in [0, 1], t >= 2 -> RMS, motion of the camera included; every pixel counts the same."""
    return jnp.sqrt(jnp.mean(jnp.diff(frames, axis=0) ** 2) / 2)


@jax.jit
def still_flicker(frames: jax.Array, distance: jax.Array, world_from_camera: jax.Array) -> jax.Array:
    """RMS of what changes on the surfaces themselves: each panorama is compared with the one before it where both see
    the same surface (the idea of Lai et al. 2018, eq. 9-10, with geometry in place of optical flow).

    frames (t, h, w, c) sRGB in [0, 1]; distance (t, h, w) true metres, 0 where unknown; world_from_camera (t, 4, 4).
    Pixels are weighted by solid angle; NaN where no two frames share a surface. Bilinear sampling smooths: noise of one
    pixel reads as 0.85 of itself under motion (sqrt(13 / 18)), and texture finer than two pixels reads as flicker.
    """

    def compare(frame, frame_distance, pose, previous, previous_distance, previous_pose):
        warped, same = _warp(previous, previous_distance, previous_pose, frame_distance, pose)
        weights = pixel_solid_angles(*same.shape) * same
        return jnp.sum(weights * jnp.mean((frame - warped) ** 2, axis=-1)), jnp.sum(weights)

    each = (frames, distance, world_from_camera)
    squares, weights = jax.vmap(compare)(*(of[1:] for of in each), *(of[:-1] for of in each))
    return jnp.sqrt(jnp.sum(squares) / jnp.sum(weights) / 2)


def _warp(
    previous: jax.Array, previous_distance: jax.Array, previous_pose: jax.Array, distance: jax.Array, pose: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """`previous` (h, w, c) as its surfaces look from `pose`, and where (h, w) it saw the surface that `pose` sees."""
    points = pose[:3, 3] + rays_of_pose(pose, *distance.shape) * distance[..., None]
    turn = jnp.matmul(previous_pose[:3, :3], world_from_camera_axes().T, precision=jax.lax.Precision.HIGHEST)
    local = jnp.matmul(points - previous_pose[:3, 3], turn, precision=jax.lax.Precision.HIGHEST)
    seen, known = sample_inverse_distance(previous_distance, local)
    same = known & (distance > 0) & (jnp.abs(jnp.linalg.norm(local, axis=-1) * seen - 1) <= VISIBLE)
    return sample_sphere(previous, *pixels_from_rays(local, *distance.shape)), same
