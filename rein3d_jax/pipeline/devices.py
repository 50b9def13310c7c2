"""Refinement with each step's views shared out over devices, of one process or of several that take the same steps."""

from collections.abc import Callable
from functools import cache

import jax
import numpy as np
from jax.sharding import Mesh

from rein3d_jax.errors import InputError
from rein3d_jax.parallel import data_parallel
from rein3d_jax.refine.step import batch_sums, update


def steps_over(mesh: Mesh) -> Callable:
    """`refine`'s `take_step` with each batch shared out over the mesh by pmap, so that a device renders its own views
    and only sums travel. Each process has all views and the whole state. It raises InputError where the devices do not
    divide the batch."""

    @cache
    def compiled(config, raster, buffers):
        def shared(carried, views, total):
            state, chance = carried
            sums, needed = batch_sums(state, views, chance.backdrop, config=config, raster=raster, buffers=buffers)
            state, metrics = update(state, total(sums), needed, chance, config=config, buffers=buffers)
            return (state, chance), metrics

        return data_parallel(shared, mesh, backend="pmap")

    def take_step(state, views, chance, *, config, raster, buffers):
        if config.batch % mesh.size:
            raise InputError(f"refine.batch {config.batch} is not divided by {mesh.size} devices; make it a multiple")
        mine = np.split(np.asarray(chance.batch), jax.process_count())[jax.process_index()]
        chosen = jax.tree.map(lambda x: np.asarray(x)[mine], views)
        (state, _), metrics = compiled(config, raster, buffers)((state, chance), chosen)
        return jax.tree.map(_here, (state, metrics))

    return take_step


def _here(array: jax.Array) -> jax.Array:
    """What all devices have, as an array of this process's own, which its other programs take."""
    return array if array.is_fully_addressable else array.addressable_data(0)
