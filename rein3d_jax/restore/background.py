"""The background fill: a hole takes what lies on its FARTHER side.

A hole that opens when the camera moves shows what an object hid, so it belongs to the background, not to the
object beside it. Cracks between splats of one surface are closed first, from all sides. Then

- where the room's shell is known, a hole shows the shell: its distance is exact, and its colour is pushed and pulled
  from what is seen of the SAME face, so a floor goes on as floor up to the wall;
- where it is not, colour and inverse distance are pushed and pulled with weights that prefer the far side.

Seam-wrapped, all in jax.numpy.
"""

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.geometry.morphology import closing, window_sum
from rein3d_jax.geometry.push_pull import push_pull
from rein3d_jax.geometry.shell import FACES, RoomShell, meet_shell
from rein3d_jax.geometry.sphere import pixel_rays, pixel_solid_angles, rays_of_pose
from rein3d_jax.scene import Panorama, Video

CRACK = 2  # pixels: a hole that a closing of this radius covers lies within one surface
OUTSIDE = 4.0  # times the median distance: beyond it lies no part of a room
ON_FACE = 0.1  # relative distance within which a pixel shows the shell and not something before it


@struct.dataclass
class Background:
    """The empty room: its shell and the colour of each face."""

    shell: RoomShell
    rgb: jax.Array  # (6, 3) mean colour of each face, as the input panorama saw it


@jax.jit
def background_of(panorama: Panorama, shell: RoomShell) -> Background:
    """The shell with the mean colour of each face in `panorama`; a face that was not seen takes the whole
    panorama's."""
    height, width = panorama.distance.shape
    distance, face = meet_shell(shell, jnp.zeros(3), pixel_rays(height, width))
    area = pixel_solid_angles(height, width)
    shows = area * panorama.valid * (jnp.abs(panorama.distance / distance - 1) < ON_FACE)
    share = shows * (face == jnp.arange(FACES)[:, None, None])
    total = jnp.einsum("fhw,hwc->fc", share, panorama.rgb) / jnp.maximum(share.sum(axis=(1, 2)), 1e-9)[:, None]
    everywhere = jnp.einsum("hw,hwc->c", area, panorama.rgb) / area.sum()
    return Background(shell, jnp.where(share.sum(axis=(1, 2))[:, None] > 0, total, everywhere))


def restore_background(video: Video, *, observed: float, background: Background | None = None) -> Video:
    """The video with every pixel of alpha below `observed` filled; the others stay to the bit. Frames are filled one by
    one."""
    known = video.alpha >= observed
    # One program a frame, not a scan over them: trajectories differ in length, and each length would compile anew.
    frames = zip(video.rgb, video.distance, known, video.world_from_camera, strict=True)
    if background is None:
        filled = [fill_from_far_side(rgb, distance, seen) for rgb, distance, seen, _ in frames]
    else:
        filled = [fill_from_shell(*frame, background) for frame in frames]
    rgb, distance = (jnp.stack(part) for part in zip(*filled, strict=True))
    return video.replace(rgb=rgb, distance=distance)


@jax.jit
def fill_from_far_side(rgb: jax.Array, distance: jax.Array, known: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Filled colour and distance of a frame (h, w, 3), (h, w) metres, (h, w) bool; one without known pixels stays."""
    known = known & (distance > 0)
    inverse = jnp.where(known, 1 / jnp.where(known, distance, 1.0), 0.0)
    image = jnp.where(known[..., None], jnp.concatenate([rgb, inverse[..., None]], axis=-1), 0.0)
    image, solid = _close_cracks(image, known)
    # What shows through a window is farther than any wall, and would be painted over every hole of the room.
    inside = solid & (image[..., 3] * jnp.nanmedian(jnp.where(known, distance, jnp.nan)) > 1 / OUTSIDE)
    filled = push_pull(image, inside.astype(jnp.float32), prefer_far=True)
    image = jnp.where(solid[..., None], image, filled)
    far = jnp.where(image[..., 3] > 0, 1 / jnp.where(image[..., 3] > 0, image[..., 3], 1.0), 0.0)
    return jnp.where(known[..., None], rgb, image[..., :3]), jnp.where(known, distance, far)


@jax.jit
def fill_from_shell(
    rgb: jax.Array, distance: jax.Array, known: jax.Array, world_from_camera: jax.Array, background: Background
) -> tuple[jax.Array, jax.Array]:
    """Filled colour and distance, as `fill_from_far_side`'s, of a frame at `world_from_camera` (4, 4) inside a room of
    known shell."""
    known = known & (distance > 0)
    image = jnp.where(known[..., None], jnp.concatenate([rgb, distance[..., None]], axis=-1), 0.0)
    image, solid = _close_cracks(image, known)
    rays = rays_of_pose(world_from_camera, *distance.shape)
    wall, face = meet_shell(background.shell, world_from_camera[:3, 3], rays)
    shows = solid & (jnp.abs(image[..., 3] / jnp.maximum(wall, 1e-6) - 1) < ON_FACE)

    def fill_face(index, colour):
        source = (shows & (face == index)).astype(jnp.float32)
        return push_pull(image[..., :3], source, otherwise=colour)

    faces = jax.vmap(fill_face)(jnp.arange(FACES), background.rgb)
    chosen = jnp.take_along_axis(faces, face[None, ..., None], axis=0)[0]
    filled = jnp.where(solid[..., None], image, jnp.concatenate([chosen, wall[..., None]], axis=-1))
    return jnp.where(known[..., None], rgb, filled[..., :3]), jnp.where(known, distance, filled[..., 3])


def _close_cracks(image, known):
    """(image, closing of `known`): holes inside the closing take the mean of what is known within CRACK pixels."""
    weight = known.astype(jnp.float32)
    closed = closing(known, CRACK)
    mean = window_sum(image * weight[..., None], CRACK) / jnp.maximum(window_sum(weight, CRACK), 1e-6)[..., None]
    return jnp.where((closed & ~known)[..., None], mean, image), closed
