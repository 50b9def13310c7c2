"""Leave out what no view would miss: Gaussians by how little they add to all views together."""

from collections.abc import Sequence

import jax
import jax.numpy as jnp

from rein3d_jax.rasterize import RasterizeConfig, accumulated_weight, allocate
from rein3d_jax.scene import Camera, Gaussians


def contribution(gaussians: Gaussians, cameras: Sequence[Camera], *, config: RasterizeConfig) -> jax.Array:
    """(n,) what each adds to the views: alpha_i T_i summed over the pixels of all views, over their number."""
    buffers = allocate(gaussians, cameras, config=config)
    total = jnp.zeros(gaussians.alive.shape)
    for camera in cameras:
        weight = accumulated_weight(gaussians, camera, config=config, buffers=buffers)
        total += weight / (camera.width * camera.height)
    return total / len(cameras)


@jax.jit
def prune_to(gaussians: Gaussians, weight: jax.Array, count: int) -> Gaussians:
    """The `count` that add most, by `contribution`; all where there are no more."""
    rank = jnp.argsort(jnp.argsort(jnp.where(gaussians.alive, -weight, jnp.inf)))
    return gaussians.replace(alive=gaussians.alive & (rank < count))
