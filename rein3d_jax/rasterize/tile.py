"""Splats -> chunks: which Gaussians, in depth order, each tile has to composite.

Buffers have the capacities of the config; what did not fit is counted, never hidden (design.md, jax-md's
allocate/update pattern). Nothing here is differentiated.
"""

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.conventions import EQUIRECTANGULAR
from rein3d_jax.rasterize.config import RasterizeConfig
from rein3d_jax.rasterize.pixels import grid
from rein3d_jax.rasterize.project import Splats
from rein3d_jax.scene import Camera


@struct.dataclass
class Chunks:
    """c chunks of l Gaussians; a tile's chunks are neighbours, front first."""

    ids: jax.Array  # (l, c) index of a splat, n (one past the last) where the slot is empty
    tile: jax.Array  # (c,) tile of each chunk; unused chunks carry the number of tiles
    rank: jax.Array  # (c,) place of each chunk in its tile's list, 0 first
    needed: jax.Array  # (2,) pairs and chunks there were; more than the buffers hold were dropped


def _argsort_packed(major: jax.Array) -> jax.Array:
    """Stable argsort of non-negative int32 through ONE 64-bit sort of (major, index): XLA sorts a single
    operand 6 times faster on a CPU than a key with a payload (33 against 222 ms for 320k; benchmarks/NOTES.md)."""
    with jax.enable_x64(True):
        index = jnp.arange(major.shape[0], dtype=jnp.int64)
        packed = jax.lax.sort((major.astype(jnp.int64) << 32) | index, is_stable=False)
        return (packed & 0x7FFFFFFF).astype(jnp.int32)


def _expand(counts: jax.Array, capacity: int) -> tuple[jax.Array, jax.Array]:
    """Owners of a ragged list: counts (n,) -> (owner, rank within owner), each (capacity,)."""
    ends = jnp.cumsum(counts)
    starts = ends - counts
    # Marking each start and taking a running maximum spreads the owners; empty owners are overwritten.
    marks = jnp.zeros(capacity, jnp.int32).at[starts].max(jnp.arange(counts.shape[0], dtype=jnp.int32), mode="drop")
    owner = jax.lax.cummax(marks)
    return owner, jnp.arange(capacity, dtype=jnp.int32) - starts[owner]


def _tile_box(splats: Splats, camera: Camera, tile: int) -> tuple[jax.Array, jax.Array]:
    """First tile (n, 2) column, row and counts (n, 2) of each splat; columns may be negative on a sphere."""
    rows, columns = grid(camera, tile)
    low = jnp.floor(jnp.clip(splats.box[:, :2], -1e6, 1e6) / tile).astype(jnp.int32)
    high = jnp.floor(jnp.clip(splats.box[:, 2:], -1e6, 1e6) / tile).astype(jnp.int32)
    limit = jnp.array([columns, rows])
    wraps = jnp.array([camera.model == EQUIRECTANGULAR, False])
    first = jnp.where(wraps, low, jnp.clip(low, 0, limit))
    last = jnp.where(wraps, high, jnp.clip(high, -1, limit - 1))
    count = jnp.clip(last - first + 1, 0, limit)
    return first, jnp.where(splats.visible[:, None], count, 0)


def needed_pairs(splats: Splats, camera: Camera, config: RasterizeConfig) -> jax.Array:
    """() number of (splat, tile) pairs: what `allocate` measures."""
    _, count = _tile_box(splats, camera, config.tile)
    return jnp.sum(count[:, 0] * count[:, 1])


def bin_splats(splats: Splats, camera: Camera, *, config: RasterizeConfig) -> Chunks:
    """Sort by distance, list the tiles of every splat, sort by tile (stable), cut each tile into chunks."""
    total = splats.mean.shape[0]
    rows, columns = grid(camera, config.tile)
    tiles = rows * columns
    first, count = _tile_box(splats, camera, config.tile)
    touched = count[:, 0] * count[:, 1]

    # Positive floats order as their bits do; unseen splats go last.
    bits = jax.lax.bitcast_convert_type(jnp.maximum(splats.distance, 0.0), jnp.int32)
    order = _argsort_packed(jnp.where(touched > 0, bits, jnp.iinfo(jnp.int32).max))

    owner, rank = _expand(touched[order], config.pair_capacity)
    splat = order[owner]
    used = rank < touched[splat]
    column = (first[splat, 0] + rank % jnp.maximum(count[splat, 0], 1)) % columns
    row = first[splat, 1] + rank // jnp.maximum(count[splat, 0], 1)
    pair_tile = jnp.where(used, row * columns + column, tiles)
    by_tile = _argsort_packed(pair_tile)
    starts = jnp.searchsorted(pair_tile[by_tile], jnp.arange(tiles + 1)).astype(jnp.int32)

    length = starts[1:] - starts[:-1]
    chunks = -(-length // config.chunk)
    tile_of, nth = _expand(chunks, config.chunk_capacity)
    slot = starts[tile_of] + nth * config.chunk + jnp.arange(config.chunk, dtype=jnp.int32)[:, None]
    filled = (slot < starts[tile_of + 1]) & (nth < chunks[tile_of])
    ids = jnp.where(filled, splat[by_tile[jnp.minimum(slot, config.pair_capacity - 1)]], total)

    needed = jnp.stack([jnp.sum(touched), jnp.sum(chunks)])
    used = nth < chunks[tile_of]
    return Chunks(ids, jnp.where(used, tile_of, tiles), jnp.where(used, nth, 0), needed)
