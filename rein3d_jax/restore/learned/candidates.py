"""From a degraded video to the network's clip: each frame's holes filled in three ways."""

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.geometry.push_pull import push_pull
from rein3d_jax.geometry.resample import sample_sphere
from rein3d_jax.geometry.shell import meet_shell
from rein3d_jax.geometry.sphere import pixels_from_rays, rays_of_pose, world_from_panorama
from rein3d_jax.restore.background import OUTSIDE, Background, fill_from_far_side, fill_from_shell
from rein3d_jax.restore.learned.condition import Clip
from rein3d_jax.scene import Video

_BEYOND = 1.5  # times the way to the shell: where the anchor saw farther than this, the shell is open there


@struct.dataclass
class Anchor:
    """The room's background, and what the first frame saw of it: by both the shell's openings are found."""

    background: Background
    distance: jax.Array  # (h, w) metres
    world_from_camera: jax.Array  # (4, 4)


def clip_of(video: Video, *, observed: float, background: Background | None) -> Clip:
    """The clip of a degraded video whose first frame is the anchor. Without a background the fill from the far side
    stands in for those by the room's shell. One program a frame: clips differ in length."""
    anchor = None if background is None else Anchor(background, video.distance[0], video.world_from_camera[0])
    frames = zip(video.rgb, video.distance, video.alpha >= observed, video.world_from_camera, strict=True)
    filled = [_candidates(*frame, anchor) for frame in frames]
    rgb, distance = (jnp.stack(part) for part in zip(*filled, strict=True))
    return Clip(video.rgb, video.alpha, video.distance, rgb, distance, positions(video.world_from_camera))


@jax.jit
def positions(world_from_camera: jax.Array) -> jax.Array:
    """Positions (t, 3) of poses (t, 4, 4) in metres from the first, in its own axes: +X lies at its centre column."""
    moved = world_from_camera[:, :3, 3] - world_from_camera[0, :3, 3]
    return jnp.matmul(moved, world_from_panorama(world_from_camera[0]), precision=jax.lax.Precision.HIGHEST)


@jax.jit
def _candidates(rgb, distance, known, pose, anchor: Anchor | None):
    """Fills (h, w, CANDIDATES, 3) and their metres (h, w, CANDIDATES) of a frame."""
    far = fill_from_far_side(rgb, distance, known)
    shell = openings = far
    if anchor is not None:
        shell = fill_from_shell(rgb, distance, known, pose, anchor.background)
        openings = fill_openings(rgb, distance, known, pose, shell, anchor)
    return tuple(jnp.stack(part, axis=2) for part in zip(shell, far, openings, strict=True))


def fill_openings(
    rgb: jax.Array,
    distance: jax.Array,
    known: jax.Array,
    world_from_camera: jax.Array,
    fill: tuple[jax.Array, jax.Array],
    anchor: Anchor,
) -> tuple[jax.Array, jax.Array]:
    """A frame's `fill` (colour (h, w, 3), metres (h, w)), but a hole in a window shows what is outside.

    The shell is open where the anchor saw far beyond it. A window's distance is mostly not known, so what shows through
    it is rendered far away, and as the camera nears the wall the window grows around it: a hole, which goes on with
    what is seen of the outside.
    """
    outside = known & (distance > OUTSIDE * jnp.median(anchor.distance))
    image = jnp.concatenate([rgb, 1 / jnp.maximum(distance, 1e-3)[..., None]], axis=-1)
    image = push_pull(jnp.where(outside[..., None], image, 0.0), outside.astype(jnp.float32))
    shown = ~known & _open(distance.shape, world_from_camera, anchor) & jnp.any(outside)
    beyond = 1 / jnp.maximum(image[..., 3], 1e-3)
    return jnp.where(shown[..., None], image[..., :3], fill[0]), jnp.where(shown, beyond, fill[1])


def _open(shape: tuple[int, int], pose: jax.Array, anchor: Anchor) -> jax.Array:
    """Pixels (h, w) bool of a panorama at `pose` behind which the anchor saw through the shell."""
    distance, origin = anchor.distance, anchor.world_from_camera
    rays = rays_of_pose(pose, *shape)
    wall, _ = meet_shell(anchor.background.shell, pose[:3, 3], rays)
    moved = pose[:3, 3] + wall[..., None] * rays - origin[:3, 3]
    moved = jnp.matmul(moved, world_from_panorama(origin), precision=jax.lax.Precision.HIGHEST)
    inverse = sample_sphere(1 / jnp.maximum(distance, 1e-3)[..., None], *pixels_from_rays(moved, *distance.shape))
    return inverse[..., 0] * jnp.linalg.norm(moved, axis=-1) < 1 / _BEYOND
