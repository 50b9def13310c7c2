"""A room's free space on a grid inside its shell, by the votes of panoramas.

A panorama says that a sample is free as far as it saw through it, and that it is not a little way behind a surface;
farther behind, it says nothing. What nobody saw is not free. As in a fused signed distance field (Curless and Levoy
1996) the mean of the votes passes 0 at the surface; but a vote weighs less the farther behind a surface it is, so that
a partition keeps both its sides.
"""

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from rein3d_jax.errors import InputError
from rein3d_jax.geometry.morphology import window_range
from rein3d_jax.geometry.resample import sample_sphere
from rein3d_jax.geometry.shell import RoomShell, world_from_shell
from rein3d_jax.geometry.sphere import holding_pixels, pixels_from_rays, world_from_panorama

FLATTENED = 0.1  # metres before a shell's face within which all is that face; guessed walls are up to 8 cm off
_REACH = 4.0  # voxels behind a surface, where votes end
_SLANT = 4.0  # cotangent of the least angle, 14 degrees, at which a surface is told from an outline
_MAX_SAMPLES = 24_000_000  # at 24 bytes each


@struct.dataclass
class FreeVotes:
    """Votes on samples (x, y, z) of a grid in the shell's own axes, FLATTENED or a little more inside its faces."""

    shell: RoomShell
    low: jax.Array  # (3,) metres, the first sample's place
    voxel: jax.Array  # () metres between samples
    sums: jax.Array  # (x, y, z, 2) of weighted signed distances in voxels, and of weights

    @property
    def signed(self) -> jax.Array:
        """Metres (x, y, z) to the nearest surface, at most a few voxels: positive where free."""
        known = self.sums[..., 1] > 0
        mean = self.sums[..., 0] / jnp.where(known, self.sums[..., 1], 1.0)
        return jnp.where(known, mean, -_REACH) * self.voxel


def shell_corners(shell: RoomShell) -> np.ndarray:
    """The lowest and the highest corner (2, 3), float64 metres, in the shell's own axes."""
    front, left, back, right = np.asarray(shell.walls, np.float64)
    return np.array([[-back, -right, -float(shell.floor)], [front, left, float(shell.ceiling)]])


def blank_votes(shell: RoomShell, voxel: float) -> FreeVotes:
    """No votes yet on samples `voxel` metres apart. Raises InputError where they are too many, or too few."""
    if not voxel > 0:
        raise InputError(f"voxel must be more than 0 metres, not {voxel}")
    low, high = shell_corners(shell)
    room = high - low - 2 * FLATTENED
    counts = np.floor(np.maximum(room, 0) / voxel).astype(int) + 1
    asked = f"voxel {voxel} asks for {' x '.join(map(str, counts))} samples"
    if np.prod(counts, dtype=float) > _MAX_SAMPLES:
        raise InputError(f"{asked}: raise it")
    if counts.min() < 4:
        raise InputError(f"{asked} of a room of {' x '.join(f'{size:.2f}' for size in high - low)} m: lower it")
    first = low + FLATTENED + (room - (counts - 1) * voxel) / 2
    return FreeVotes(shell, jnp.asarray(first, jnp.float32), jnp.float32(voxel), jnp.zeros((*map(int, counts), 2)))


def _vote(votes: FreeVotes, distance: jax.Array, world_from_camera: jax.Array) -> FreeVotes:
    """The votes with those of one more panorama (h, 2 h), metres along the ray, 0 where unknown; its pose (4, 4) is of
    OpenCV axes."""
    shell_from_world = world_from_shell(votes.shell).T
    camera = jnp.matmul(shell_from_world, world_from_camera[:3, 3], precision="highest")
    rotation = jnp.matmul(shell_from_world, world_from_panorama(world_from_camera), precision="highest")
    nearest, farthest = window_range(distance)
    # By how much the farthest of 3 x 3 pixels of a slanted plane is farther than the nearest, two pixels away.
    same_surface = 1 + _SLANT * 2 * jnp.pi / distance.shape[0]
    inverse = 1 / jnp.maximum(distance, 1e-6)
    _, y, z = (votes.low[axis] + jnp.arange(size) * votes.voxel for axis, size in enumerate(votes.sums.shape[:3]))

    def slab(carried):  # one x at a time: a whole room's rays would take gigabytes
        index, sums = carried
        x = jnp.broadcast_to(votes.low[0] + index * votes.voxel, (y.size, z.size))
        offset = jnp.stack([x, *jnp.meshgrid(y, z, indexing="ij")], axis=-1) - camera
        u, v = pixels_from_rays(jnp.matmul(offset, rotation, precision="highest"), *distance.shape)
        held = holding_pixels(u, v, *distance.shape)
        # Of a plane 1/d is linear between pixels; at an outline nothing is seen beyond the nearer surface.
        surface = farthest[held] < same_surface * nearest[held]
        seen = jnp.where(surface, 1 / sample_sphere(inverse, u, v), nearest[held])
        signed = (seen - jnp.linalg.norm(offset, axis=-1)) / votes.voxel
        behind = jnp.where(surface, jnp.maximum(1 + signed / _REACH, 0.0), 0.0)
        weight = jnp.where(signed > 0, 1.0, behind)
        return sums + jnp.stack([weight * jnp.clip(signed, -_REACH, _REACH), weight], axis=-1)

    return votes.replace(sums=jax.lax.map(slab, (jnp.arange(votes.sums.shape[0]), votes.sums)))


vote = jax.jit(_vote)
