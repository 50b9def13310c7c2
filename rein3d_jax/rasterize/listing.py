"""Gaussians + camera -> splats and the lists of them that each tile composites: all that precedes compositing."""

import jax
import jax.numpy as jnp

from rein3d_jax.rasterize.buffers import Buffers
from rein3d_jax.rasterize.config import RasterizeConfig
from rein3d_jax.rasterize.cull import at_least_one, gather_in_view, in_view
from rein3d_jax.rasterize.project import Splats, project
from rein3d_jax.rasterize.tile import Chunks, bin_splats
from rein3d_jax.scene import Camera, Gaussians


def list_splats(
    gaussians: Gaussians,
    camera: Camera,
    *,
    config: RasterizeConfig,
    buffers: Buffers,
    means2d_offset: jax.Array | None = None,
) -> tuple[Splats, Chunks, jax.Array, jax.Array]:
    """Splats (v,), their chunks, the Gaussian of each splat (v,) (n where none), and the buffer sizes needed (4,).

    `means2d_offset` (n, 2) is `project`'s, one row a Gaussian.
    """
    gaussians = at_least_one(gaussians)
    mask = in_view(jax.lax.stop_gradient(gaussians), camera, config=config)
    seen, ids = gather_in_view(gaussians, mask, buffers.visible)
    if means2d_offset is not None:
        means2d_offset = jnp.take(means2d_offset, ids, axis=0, mode="fill", fill_value=0.0)
    splats = project(seen, camera, config=config, means2d_offset=means2d_offset)
    chunks = bin_splats(jax.lax.stop_gradient(splats), camera, config=config, buffers=buffers)
    return splats, chunks, ids, jnp.concatenate([jnp.sum(mask)[None], chunks.needed])
