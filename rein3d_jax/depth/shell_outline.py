"""A room's shell seen from inside: its twelve lines, and which part of it each pixel shows."""

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.shell import RoomShell, world_from_shell
from rein3d_jax.geometry.sphere import pixel_rays

_SHARPNESS = 30.0  # where two planes are equally far a ray belongs half to each; where one is 10 % nearer, 95 %


def shell_edges(shell: RoomShell) -> tuple[jax.Array, jax.Array]:
    """Both ends of the twelve edges, each (12, 3) metres: four on the floor, four on the ceiling, four upright."""
    front, left, back, right = shell.walls
    ring = jnp.stack([front, left, -back, left, -back, -right, front, -right]).reshape(4, 2)
    low = jnp.pad(ring, ((0, 0), (0, 1))).at[:, 2].set(-shell.floor)
    high = low.at[:, 2].set(shell.ceiling)
    starts = jnp.concatenate([low, high, low])
    ends = jnp.concatenate([jnp.roll(low, -1, axis=0), jnp.roll(high, -1, axis=0), high])
    world_from_box = world_from_shell(shell)
    return starts @ world_from_box.T, ends @ world_from_box.T


def shell_parts(shell: RoomShell, height: int, width: int) -> jax.Array:
    """The shares (height, width, 3) of walls, ceiling and floor in each pixel; differentiable."""
    x, y, z = jnp.moveaxis(pixel_rays(height, width) @ world_from_shell(shell), -1, 0)
    planes = jnp.concatenate([shell.walls, shell.ceiling[None], shell.floor[None]])
    nearness = jnp.stack([x, y, -x, -y, z, -z], axis=-1) / planes  # 1 / metres, negative behind the ray
    parts = jax.nn.softmax(_SHARPNESS * jnp.log(jnp.maximum(nearness, 1e-6)), axis=-1)
    return jnp.stack([jnp.sum(parts[..., :4], axis=-1), parts[..., 4], parts[..., 5]], axis=-1)
