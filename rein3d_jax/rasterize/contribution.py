"""What each Gaussian gives to a picture."""

from functools import partial

import jax
import jax.numpy as jnp

from rein3d_jax.rasterize.buffers import Buffers
from rein3d_jax.rasterize.composite import composite_chunks
from rein3d_jax.rasterize.config import RasterizeConfig
from rein3d_jax.rasterize.listing import list_splats
from rein3d_jax.rasterize.pixels import from_tiles
from rein3d_jax.scene import Camera, Gaussians


@partial(jax.jit, static_argnames=("config", "buffers"))
def accumulated_weight(gaussians: Gaussians, camera: Camera, *, config: RasterizeConfig, buffers: Buffers) -> jax.Array:
    """The weights (n,) sum of w_i = alpha_i T_i over pixels: what each Gaussian adds to this view; over all Gaussians
    they sum to the picture's alpha. `buffers` are `allocate`'s, for a view that does not overflow.

    The picture of a value that is v_i on Gaussian i is sum_i w_i v_i: its gradient by v is the weight.
    """
    splats, chunks, ids, _ = list_splats(gaussians, camera, config=config, buffers=buffers)

    def painted(values):
        tiles = composite_chunks(splats, values[:, None], chunks, camera, config.tile)
        return jnp.sum(from_tiles(tiles, camera, config.tile)[..., 0])

    weight = jax.grad(painted)(jnp.zeros(ids.shape))
    return jnp.zeros(gaussians.alive.shape).at[ids].add(weight, mode="drop")
