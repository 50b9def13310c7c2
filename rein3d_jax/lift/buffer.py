"""The scene's buffer: its capacity, new Gaussians into dead slots, and the living ones moved together."""

import jax
import jax.numpy as jnp

from rein3d_jax.errors import InputError
from rein3d_jax.scene import Gaussians


def with_capacity(gaussians: Gaussians, capacity: int) -> Gaussians:
    """The same scene in a buffer of `capacity` slots (0: twice its own), the new ones dead and finite.

    Raises InputError where the scene does not fit: nothing is dropped to make it.
    """
    count = gaussians.alive.shape[0]
    capacity = capacity or 2 * count
    if capacity < count:
        raise InputError(f"lift.capacity {capacity:_} < {count:_} pixels; raise it or lower lift.share")
    grow = capacity - count
    padded = jax.tree.map(lambda x: jnp.pad(x, [(0, grow)] + [(0, 0)] * (x.ndim - 1)), gaussians)
    return padded.replace(quats=padded.quats.at[capacity - grow :, 0].set(1.0))


def _merge(scene: Gaussians, new: Gaussians) -> tuple[Gaussians, jax.Array]:
    """The scene with the alive ones of `new` in its first dead slots, and how many found none. Both of the same
    degree."""
    count, room = scene.alive.shape[0], new.alive.shape[0]
    free = jnp.nonzero(~scene.alive, size=room, fill_value=count)[0]
    rank = jnp.cumsum(new.alive) - 1
    target = jnp.where(new.alive, free[jnp.maximum(rank, 0)], count)
    merged = jax.tree.map(lambda old, fresh: old.at[target].set(fresh, mode="drop"), scene, new)
    return merged, jnp.sum(new.alive & (target == count))


merge = jax.jit(_merge)


def compact(scene: Gaussians, *, spare: float = 0.0) -> Gaussians:
    """The living ones in their order, in a buffer of that size plus a share of `spare` dead slots. Outside jit."""
    living = jax.tree.map(lambda x: x[scene.alive], scene)
    return with_capacity(living, int(living.alive.shape[0] * (1 + spare)))
