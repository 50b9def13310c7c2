"""Data parallelism behind one call: `jit` over a mesh, or `pmap`, which pods run too.

A step sees examples and sums over them with `total`; what is left is the same program on one device and on many:

    def step(state, batch, total):
        loss, gradient = total(jax.value_and_grad(loss_sum)(state, batch))

jit lays the batch over the mesh and finds the sums across devices by itself, so there `total` is the identity. pmap
runs the step on each device's share, and `total` is a psum. Its trap: the gradient OF a psum comes out n times each
device's own, silently; so the sum is taken of the gradient, as above.
"""

from collections.abc import Callable
from functools import cache, partial
from typing import Any

import jax
import numpy as np
from jax import lax
from jax.sharding import Mesh, NamedSharding, PartitionSpec

from rein3d_jax.errors import InputError
from rein3d_jax.parallel.mesh import DATA, share_batch, state_shardings

BACKENDS = ("jit", "pmap")
Total = Callable[[Any], Any]
Step = Callable[[Any, Any, Total], Any]


def data_parallel(
    step: Step, mesh: Mesh, *, backend: str = "jit", axis: int = 0, sharded: bool = False
) -> Callable[[Any, Any], tuple[Any, Any]]:
    """`step(state, batch, total) -> (state, result)` as `f(state, batch)`: the batch shared out along `axis`, state
    and result on every device; or, `sharded`, the state laid out as by `state_shardings` (fully sharded data
    parallelism: XLA gathers what it needs when it needs it; only for jit). The state passed in is used up. The batch
    is this host's, as NumPy arrays, and divides by its devices. Raises InputError for an unknown backend."""
    if backend not in BACKENDS:
        raise InputError(f'backend "{backend}" is unknown; choose one of {", ".join(BACKENDS)}')
    if backend == "jit":
        return _over_mesh(step, mesh, axis, sharded)
    if sharded:
        raise InputError('backend "pmap" has the whole state on each device; choose "jit" to shard it')
    return _over_replicas(step, mesh, axis)


def _over_mesh(step: Step, mesh: Mesh, axis: int, sharded: bool):
    everywhere = NamedSharding(mesh, PartitionSpec())
    shared = NamedSharding(mesh, PartitionSpec(*[None] * axis, DATA))

    @cache
    def compiled(structure, shapes):
        state = jax.tree.unflatten(structure, [jax.ShapeDtypeStruct(shape, bool) for shape in shapes])
        layout = state_shardings(mesh, state) if sharded else everywhere
        return jax.jit(
            partial(step, total=lambda x: x),
            in_shardings=(layout, shared),
            out_shardings=(layout, everywhere),
            donate_argnums=0,
        )

    def run(state, batch):
        leaves, structure = jax.tree.flatten(state)
        return compiled(structure, tuple(map(np.shape, leaves)))(state, share_batch(mesh, batch, axis))

    return run


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
