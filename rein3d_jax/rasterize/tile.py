"""Splats -> chunks: which Gaussians, in depth order, each tile has to composite.

Lists have the sizes of the buffers; what did not fit is counted, never hidden (the allocate and update pattern of
jax-md). Nothing here is differentiated.
"""

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.rasterize.buffers import Buffers
from rein3d_jax.rasterize.config import RasterizeConfig
from rein3d_jax.rasterize.pixels import grid
from rein3d_jax.rasterize.project import Splats
from rein3d_jax.rasterize.strips import tile_columns, tile_rows
from rein3d_jax.scene import Camera

_MEASURED = 16_384  # (splat, row of tiles) pairs that are measured at a time


@struct.dataclass
class Chunks:
    """Chunks of l Gaussians, c of them, the fullest first: neighbours then take the same number of steps.

    `order` lists them by tile, and front first within a tile: chunk order[i] is followed by chunk order[i + 1].
    """

    ids: jax.Array  # (l, c) index of a splat, n (one past the last) where the slot is empty
    tile: jax.Array  # (c,) tile of each chunk; unused chunks carry the number of tiles
    fill: jax.Array  # (c,) Gaussians in each chunk, 0 where unused
    order: jax.Array  # (c,) see above
    position: jax.Array  # (c,) the inverse of `order`
    rank: jax.Array  # (c,) by position: place of the chunk in its tile's list, 0 first
    needed: jax.Array  # (3,) (splat, row of tiles) pairs, (splat, tile) pairs and chunks; more were dropped


def _argsort_packed(major: jax.Array) -> jax.Array:
    """Stable argsort of non-negative int32 through ONE 64-bit sort of (major, index): XLA sorts a single
    operand 6 times faster on a CPU than a key with a payload (33 against 222 ms for 320k; benchmarks/README.md)."""
    with jax.enable_x64(True):
        index = jnp.arange(major.shape[0], dtype=jnp.int64)
        packed = jax.lax.sort((major.astype(jnp.int64) << 32) | index, is_stable=False)
        return (packed & 0x7FFFFFFF).astype(jnp.int32)


def _expand(counts: jax.Array, capacity: int) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Owners of a ragged list: counts (n,) -> (owner, rank within owner, whether used), each (capacity,)."""
    ends = jnp.cumsum(counts)
    starts = ends - counts
    # Marking each start and taking a running maximum spreads the owners; empty owners are overwritten.
    marks = jnp.zeros(capacity, jnp.int32).at[starts].max(jnp.arange(counts.shape[0], dtype=jnp.int32), mode="drop")
    owner = jax.lax.cummax(marks)
    rank = jnp.arange(capacity, dtype=jnp.int32) - starts[owner]
    return owner, rank, rank < counts[owner]


def needed_lists(splats: Splats, camera: Camera, *, config: RasterizeConfig) -> jax.Array:
    """The numbers (3,) of (splat, row of tiles) pairs, of (splat, tile) pairs and of chunks: what `allocate` measures.
    No list is made."""
    first, count = tile_rows(splats, camera, config=config)
    ends, total = jnp.cumsum(count), jnp.sum(count)
    rows, columns = grid(camera, config.tile)

    def add_block(number, edges):
        """Rows of tiles by the thousand: most splats have one or two of them, and a few have all."""
        nth = number * _MEASURED + jnp.arange(_MEASURED)
        owner = jnp.minimum(jnp.searchsorted(ends, nth, side="right"), count.size - 1)
        row = first[owner] + nth - (ends - count)[owner]
        start, across = tile_columns(splats, owner, row, camera, config=config)
        start, used = start % columns, (nth < total).astype(jnp.int32)  # a panorama's may begin left of the seam
        return edges.at[row, start].add(used, mode="drop").at[row, start + across].add(-used, mode="drop")

    # Where a list of splats begins and ends in a row of tiles, which may go round once.
    edges = jnp.zeros((rows, 2 * columns + 1), jnp.int32)
    edges = jax.lax.fori_loop(0, -(-total // _MEASURED), add_block, edges)
    length = jnp.sum(jnp.cumsum(edges, axis=1)[:, :-1].reshape(rows, 2, columns), axis=1)
    return jnp.stack([total, jnp.sum(length), jnp.sum(-(-length // config.chunk))])


def _pairs(splats: Splats, camera: Camera, config: RasterizeConfig, buffers: Buffers):
    """Pairs of splat and tile, nearest splat first: splat (p,), tile (p,) (one past the last where unused), needed
    (2,)."""
    rows, columns = grid(camera, config.tile)
    first_row, row_count = tile_rows(splats, camera, config=config)
    # Positive floats order as their bits do; unseen splats go last.
    bits = jax.lax.bitcast_convert_type(jnp.maximum(splats.distance, 0.0), jnp.int32)
    order = _argsort_packed(jnp.where(row_count > 0, bits, jnp.iinfo(jnp.int32).max))

    owner, nth, used = _expand(row_count[order], buffers.rows)
    splat = order[owner]
    row = first_row[splat] + nth
    first_column, column_count = tile_columns(splats, splat, row, camera, config=config)
    column_count = jnp.where(used, column_count, 0)

    owner, nth, used = _expand(column_count, buffers.pairs)
    tile = row[owner] * columns + (first_column[owner] + nth) % columns
    needed = jnp.stack([jnp.sum(row_count), jnp.sum(column_count)])
    return splat[owner], jnp.where(used, tile, rows * columns), needed


def bin_splats(splats: Splats, camera: Camera, *, config: RasterizeConfig, buffers: Buffers) -> Chunks:
    """Sort by distance, list the tiles of every splat, sort by tile (stable), cut each tile into chunks."""
    total = splats.mean.shape[0]
    rows, columns = grid(camera, config.tile)
    tiles = rows * columns
    splat, tile, needed = _pairs(splats, camera, config, buffers)
    by_tile = _argsort_packed(tile)
    starts = jnp.searchsorted(tile[by_tile], jnp.arange(tiles + 1)).astype(jnp.int32)

    length = starts[1:] - starts[:-1]
    chunks = -(-length // config.chunk)
    tile_of, rank, used = _expand(chunks, buffers.chunks)
    first = starts[tile_of] + rank * config.chunk
    fill = jnp.where(used, jnp.minimum(starts[tile_of + 1] - first, config.chunk), 0)

    position = _argsort_packed(config.chunk - fill)
    order = _argsort_packed(position)
    fill, nth = fill[position], jnp.arange(config.chunk, dtype=jnp.int32)[:, None]
    slot = jnp.minimum(first[position] + nth, buffers.pairs - 1)
    ids = jnp.where(nth < fill, splat[by_tile][slot], total)
    needed = jnp.concatenate([needed, jnp.sum(chunks)[None]])
    tile = jnp.where(used, tile_of, tiles)[position]
    return Chunks(ids, tile, fill, order, position, jnp.where(used, rank, 0), needed)
