"""The scene's buffer: its capacity, new Gaussians into dead slots, and the living ones moved together."""

import jax
import jax.numpy as jnp
import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.scene import Gaussians


def with_capacity(gaussians: Gaussians, capacity: int) -> Gaussians:
    """The same scene in a buffer of `capacity` slots, the new ones dead and finite. Outside jit.

    Raises InputError where the scene does not fit: nothing is dropped to make it.
    """
    count = gaussians.alive.shape[0]
    if capacity < count:
        raise InputError(f"lift.capacity {capacity:_} < {count:_} pixels; raise it or lower lift.share")
    grow = capacity - count
    padded = jax.tree.map(lambda x: np.pad(x, [(0, grow)] + [(0, 0)] * (x.ndim - 1)), gaussians)
    padded.quats[count:, 0] = 1.0
    return jax.device_put(padded)


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


def compact(scene: Gaussians, *, capacity: int | None = None) -> Gaussians:
    """The living ones in their order, in a buffer of `capacity` slots or, without one, of their number. Outside jit.
    Raises InputError where they do not fit."""
    alive = np.asarray(scene.alive)  # NumPy: every count would compile programs of its own
    count = int(alive.sum())
    living = jax.tree.map(lambda x: np.asarray(x)[alive], scene)
    return with_capacity(living, count if capacity is None else capacity)
