"""From a degraded video to what the network is told: each frame's holes filled in three ways."""

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.push_pull import push_pull
from rein3d_jax.geometry.resample import sample_sphere
from rein3d_jax.geometry.shell import meet_shell
from rein3d_jax.geometry.sphere import pixels_from_rays, rays_of_pose, world_from_camera_axes
from rein3d_jax.restore.background import OUTSIDE, Background, fill_from_far_side, fill_from_shell
from rein3d_jax.restore.learned.condition import Clip
from rein3d_jax.scene import Video

BEYOND = 1.5  # times the way to the shell: where the anchor saw farther than this, the shell is open there


def clip_of(video: Video, *, observed: float, background: Background | None) -> Clip:
    """The clip of a degraded video whose first frame is the anchor. Without a background the fill from the far side
    stands in for those by the room's shell. One program a frame: clips differ in length."""
    anchor = (video.distance[0], video.world_from_camera[0])
    frames = zip(video.rgb, video.alpha, video.distance, video.world_from_camera, strict=True)
    filled = [_candidates(*frame, observed, background, anchor) for frame in frames]
    rgb, distance = (jnp.stack(part) for part in zip(*filled, strict=True))
    return Clip(video.rgb, video.alpha, video.distance, rgb, distance, positions(video.world_from_camera))


def positions(world_from_camera: jax.Array) -> jax.Array:
    """(t, 4, 4) -> (t, 3) metres from the first frame, in its own axes: +X is what lies at its centre column."""
    moved = world_from_camera[:, :3, 3] - world_from_camera[0, :3, 3]
    return jnp.matmul(moved, _turn(world_from_camera[0]), precision=jax.lax.Precision.HIGHEST)


def _turn(pose: jax.Array) -> jax.Array:
    """(3, 3): the world's vectors from those in a panorama's axes, as a matrix to the right of rows."""
    return jnp.matmul(pose[:3, :3], world_from_camera_axes().T, precision=jax.lax.Precision.HIGHEST)


def _candidates(rgb, alpha, distance, pose, observed, background, anchor):
    """(h, w, FILLS, 3), (h, w, FILLS)."""
    known = alpha >= observed
    far = fill_from_far_side(rgb, distance, known)
    shell = openings = far
    if background is not None:
        shell = fill_from_shell(rgb, distance, known, pose, background)
        openings = fill_openings(rgb, distance, known, pose, shell, background, anchor)
    return tuple(jnp.stack(part, axis=2) for part in zip(shell, far, openings, strict=True))


@jax.jit
def fill_openings(
    rgb: jax.Array,
    distance: jax.Array,
    known: jax.Array,
    world_from_camera: jax.Array,
    fill: tuple[jax.Array, jax.Array],
    background: Background,
    anchor: tuple[jax.Array, jax.Array],
) -> tuple[jax.Array, jax.Array]:
    """A frame's `fill` (colour (h, w, 3), metres (h, w)), but a hole in a window shows what is outside.

    The anchor (its distance (h, w), its pose) tells where the shell is open: where it saw far beyond it. A window's
    distance is mostly not known, so what shows through it is rendered far away, and as the camera nears the wall the
    window grows around it: a hole, which goes on with what is seen of the outside.
    """
    outside = known & (distance > OUTSIDE * jnp.median(anchor[0]))
    image = jnp.concatenate([rgb, 1 / jnp.maximum(distance, 1e-3)[..., None]], axis=-1)
    image = push_pull(jnp.where(outside[..., None], image, 0.0), outside.astype(jnp.float32))
    shown = ~known & _open(distance.shape, world_from_camera, background, anchor) & jnp.any(outside)
    beyond = 1 / jnp.maximum(image[..., 3], 1e-3)
    return jnp.where(shown[..., None], image[..., :3], fill[0]), jnp.where(shown, beyond, fill[1])


def _open(shape: tuple[int, int], pose: jax.Array, background: Background, anchor) -> jax.Array:
    """(h, w) bool: behind which pixels of a panorama at `pose` the anchor saw through the shell."""
    distance, origin = anchor
    rays = rays_of_pose(pose, *shape)
    reach, _ = meet_shell(background.shell, pose[:3, 3], rays)
    moved = pose[:3, 3] + reach[..., None] * rays - origin[:3, 3]
    moved = jnp.matmul(moved, _turn(origin), precision=jax.lax.Precision.HIGHEST)
    inverse = sample_sphere(1 / jnp.maximum(distance, 1e-3)[..., None], *pixels_from_rays(moved, *distance.shape))
    return inverse[..., 0] * jnp.linalg.norm(moved, axis=-1) < 1 / BEYOND
