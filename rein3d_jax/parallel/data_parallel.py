"""Data parallelism behind one call: `jit` over a mesh, or `pmap`, which pods run too.

A step sees examples and sums over them with `total`; what is left is the same program on one device and on many:

    def step(state, batch, total):
        gradient, weight = jax.grad(lambda p: total(loss_sum(p, batch))), total(weight_sum(batch))

jit lays the batch over the mesh and finds the sums across devices by itself, so there `total` is the identity. pmap
runs the step on each device's share, and `total` is a psum. Its trap: a gradient taken BEFORE the psum comes out n
times too large under jax's checked shard_map, silently; so the gradient is taken of the total, as above.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import numpy as np
from jax import lax
from jax.sharding import Mesh, NamedSharding, PartitionSpec

from rein3d_jax.errors import InputError
from rein3d_jax.parallel.mesh import DATA, share_batch

BACKENDS = ("jit", "pmap")
Total = Callable[[Any], Any]
Step = Callable[[Any, Any, Total], Any]


def data_parallel(step: Step, mesh: Mesh, *, backend: str = "jit", axis: int = 0) -> Callable[[Any, Any], Any]:
    """`step(state, batch, total)` as `f(state, batch)`: state and result on every device, the batch shared out along
    `axis`; the state passed in is used up. The batch is this host's, as NumPy arrays, and divides by its devices."""
    if backend not in BACKENDS:
        raise InputError(f'backend "{backend}" is unknown; choose one of {", ".join(BACKENDS)}')
    over = _over_mesh if backend == "jit" else _over_replicas
    return over(step, mesh, axis)


def _over_mesh(step: Step, mesh: Mesh, axis: int):
    everywhere = NamedSharding(mesh, PartitionSpec())
    shared = NamedSharding(mesh, PartitionSpec(*[None] * axis, DATA))
    run = jax.jit(
        partial(step, total=lambda x: x),
        in_shardings=(everywhere, shared),
        out_shardings=everywhere,
        donate_argnums=0,
    )
    return lambda state, batch: run(state, share_batch(mesh, batch, axis))


def _over_replicas(step: Step, mesh: Mesh, axis: int):
    here = [device for device in mesh.devices.flat if device.process_index == jax.process_index()]
    total = partial(lax.psum, axis_name=DATA)
    run = jax.pmap(
        partial(step, total=total), axis_name=DATA, in_axes=(None, 0), out_axes=None, devices=list(mesh.devices.flat)
    )

    def split(array):
        shape = (*array.shape[:axis], len(here), array.shape[axis] // len(here), *array.shape[axis + 1 :])
        return np.moveaxis(array.reshape(shape), axis, 0)

    return lambda state, batch: run(state, jax.tree.map(split, batch))


