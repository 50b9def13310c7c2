"""The room behind what stands in it: the panorama with everything before the room's shell taken away, for a restorer
to fill. Each ray then has one answer, whatever paths are taken later."""

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.morphology import window_range
from rein3d_jax.geometry.push_pull import push_pull
from rein3d_jax.geometry.resample import sample_sphere
from rein3d_jax.geometry.shell import RoomShell, meet_shell
from rein3d_jax.geometry.sphere import holding_pixels, pixel_rays, pixels_from_rays
from rein3d_jax.scene import Panorama, Video

_ON_SHELL = 0.1  # relative distance before the shell within which a pixel shows the room itself
_BEHIND = 0.03  # relative, and
_HAND = 0.02  # metres, that a guess lies behind what hides it, at least


def without_things(panorama: Panorama, shell: RoomShell, pose: jax.Array, *, rows: int) -> Video:
    """Two frames (2, rows, 2 rows) at `pose` (4, 4), the panorama's own: as it is, and, alpha 0, with all that stands
    before `shell` taken away. What lies beyond the shell, outside or in the next room, stays. The panorama's distance
    is complete."""
    return _without_things(_resized(panorama, rows), shell, pose)


@jax.jit
def _without_things(panorama: Panorama, shell: RoomShell, pose: jax.Array) -> Video:
    rgb, distance = panorama.rgb, panorama.distance
    wall, _ = meet_shell(shell, jnp.zeros(3), pixel_rays(*distance.shape))
    # A pixel less all around: at its outline a thing's colours are mixed into what lies behind.
    room, _ = window_range((distance > (1 - _ON_SHELL) * wall).astype(jnp.float32))
    alpha = jnp.stack([jnp.ones_like(room), room])
    both = jnp.stack([rgb, rgb * room[..., None]]), alpha, jnp.stack([distance, distance * room])
    return Video(*both, jnp.stack([pose, pose]))


@jax.jit
def behind_things(taken: Video, restored: Video, shell: RoomShell) -> tuple[Panorama, jax.Array]:
    """The room's layer as a panorama (h, w) of `without_things`' video after restoring, and where (h, w) bool it lies
    behind what hides it. Its distance is the shell's, brought onto the walls that were seen."""
    wall, _ = meet_shell(shell, jnp.zeros(3), pixel_rays(*taken.alpha.shape[1:]))
    front, room = taken.distance[0], taken.alpha[1] > 0
    seen = room & (jnp.abs(front / wall - 1) < _ON_SHELL)
    # A real wall is not quite the box's: where it goes on behind things it goes on from where it was seen.
    off = push_pull(jnp.where(seen, jnp.log(front / wall), 0.0)[..., None], seen.astype(jnp.float32))[..., 0]
    distance = wall * jnp.exp(off)
    hidden = ~room & (distance > (1 + _BEHIND) * front + _HAND)
    return Panorama(restored.rgb[1], distance, jnp.ones_like(room)), hidden


def _resized(panorama: Panorama, rows: int) -> Panorama:
    """The panorama (rows, 2 rows): colours between pixels, of distances the nearest."""
    height, width = panorama.distance.shape
    if height == rows:
        return panorama
    u, v = pixels_from_rays(pixel_rays(rows, 2 * rows), height, width)
    held = holding_pixels(u, v, height, width)
    nearest = panorama.distance[held], panorama.valid[held]
    return Panorama(sample_sphere(panorama.rgb, u, v), *nearest)
