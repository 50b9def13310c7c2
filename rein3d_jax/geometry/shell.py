"""A room's shell: the upright box of floor, ceiling and four walls, and where rays from inside meet it."""

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.geometry.rotations import matrix_from_quats, yaw_quat

FACES = 6  # +x, +y, -x, -y in the box's own axes, then ceiling, floor


@struct.dataclass
class RoomShell:
    """An upright box around the origin, in the world frame."""

    yaw: jax.Array  # () radians by which the box is rotated LEFT
    walls: jax.Array  # (4,) metres to the walls at yaw + 0, 90, 180, 270 degrees, counted to the left
    floor: jax.Array  # () metres below the origin, positive
    ceiling: jax.Array  # () metres above the origin, positive


def world_from_shell(shell: RoomShell) -> jax.Array:
    """The rotation (3, 3) from the box's own axes to the world."""
    return matrix_from_quats(yaw_quat(shell.yaw))


def _bounds(shell: RoomShell) -> jax.Array:
    """Metres (6,) from the origin to each face."""
    return jnp.concatenate([shell.walls, shell.ceiling[None], shell.floor[None]])


def meet_shell(shell: RoomShell, origin: jax.Array, rays: jax.Array) -> tuple[jax.Array, jax.Array]:
    """(distance (...) metres, face (...) int) at which unit rays (..., 3) from `origin` (3,), world frame, meet the
    shell.

    From a point outside a face the distance to that face is 0: such a point has left the room."""
    rotation = world_from_shell(shell)
    start = jnp.matmul(origin, rotation, precision="highest")
    along = jnp.matmul(rays, rotation, precision="highest")
    # Outward components: faces 0, 1 look along +x, +y, faces 2, 3 back along them, then up and down.
    outward = jnp.concatenate([along[..., :2], -along[..., :2], along[..., 2:], -along[..., 2:]], axis=-1)
    reach = jnp.concatenate([start[:2], -start[:2], start[2:], -start[2:]])
    # A ray along a plane never meets it; 1e-9 puts that meeting farther than any other.
    meets = jnp.where(outward > 0, jnp.maximum(_bounds(shell) - reach, 0.0) / jnp.maximum(outward, 1e-9), jnp.inf)
    return jnp.min(meets, axis=-1), jnp.argmin(meets, axis=-1)
