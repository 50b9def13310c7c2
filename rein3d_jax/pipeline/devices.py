"""Refinement with each step's views shared out over devices."""

from collections.abc import Callable
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh

from rein3d_jax.errors import InputError
from rein3d_jax.parallel import data_parallel
from rein3d_jax.refine.step import step


def steps_over(mesh: Mesh) -> Callable:
    """`refine`'s `run`: as `step.steps`, with each batch shared out over the mesh by pmap, so that a device renders its
    own views and only sums travel. Raises InputError where the devices do not divide the batch."""

    @cache
    def compiled(config, raster):
        def shared(state, views, total):
            state, *rest = state
            state, metrics = step(state, views, *rest, config=config, raster=raster, total=total)
            return (state, *rest), metrics

        return data_parallel(shared, mesh, backend="pmap")

    def run(state, views, batches, backdrops, extent, key, *, config, raster):
        if config.batch % mesh.size:
            raise InputError(f"refine.batch {config.batch} is not divided by {mesh.size} devices; make it a multiple")
        found = []
        for batch, backdrop in zip(np.asarray(batches), backdrops, strict=True):
            chosen = jax.tree.map(lambda x, batch=batch: np.asarray(x)[batch], views)
            carried = (state, jnp.float32(extent), backdrop, key)
            (state, *_), metrics = compiled(config, raster)(carried, chosen)
            found.append(metrics)
        return state, jax.tree.map(lambda *x: jnp.stack(x), *found)

    return run
