"""Front-to-back compositing of chunked splats, with its own reverse pass.

    w_i = alpha_i T_i,   T_{i+1} = T_i (1 - alpha_i),   image = sum_i w_i value_i     (Kerbl et al. 2023, eq. 3)

A chunk is a scan over its Gaussians, vectorised over chunks x pixels with the pixels innermost (3 ns an
evaluation on 2 cores here; chunks innermost took 10, see benchmarks/NOTES.md). Chunks of a tile join by the
associative "over". The reverse pass walks front to back too, with the weighted sum still to come as its
carry, so nothing per evaluation is stored and nothing is divided by a small transmittance.
"""

import math
from functools import partial

import jax
import jax.numpy as jnp

from rein3d_jax.conventions import ALPHA_CUT, ALPHA_MAX
from rein3d_jax.rasterize.tile import Chunks

BLOCK = 512  # chunks handled at a time: their carry fits a core's second-level cache


def gather_rows(mean, axes, log_opacity, values, ids, anchors):
    """Per-slot rows (l, m, c): whitened offset of the chunk's anchor (k), axes (k^2), log opacity, values.

    `anchors` (c, k) is a feature near each chunk's tile: offsets from it stay small, so float32 suffices.
    An empty slot has log opacity -100, alpha 0.
    """
    n, k = mean.shape
    rows = jnp.concatenate([mean, axes.reshape(n, k * k), log_opacity[:, None], values], axis=-1)
    empty = jnp.zeros((1, rows.shape[1])).at[0, k + k * k].set(-100.0)
    rows = jnp.concatenate([rows, empty])[ids]
    offset = anchors - rows[..., :k]
    head = [jnp.sum(rows[..., k * (i + 1) : k * (i + 2)] * offset, axis=-1) for i in range(k)]
    return jnp.moveaxis(jnp.concatenate([jnp.stack(head, axis=-1), rows[..., k:]], axis=-1), -1, 1)


def _alpha(row, pixels):
    """row (m, c), pixels k x (c or 1, p) -> whitened offsets k x (c, p), raw and cut, clamped alpha (c, p)."""
    k = len(pixels)
    white = [
        row[i][:, None] + sum(row[k * (i + 1) + j][:, None] * pixels[j] for j in range(k)) for i in range(k)
    ]
    raw = jnp.exp(row[k + k * k][:, None] - 0.5 * sum(w * w for w in white))
    return white, raw, jnp.where(raw < ALPHA_CUT, 0.0, jnp.minimum(raw, ALPHA_MAX))


def _first_value(k: int) -> int:
    return k + k * k + 1


def _planes(pixels):
    return tuple(jnp.moveaxis(pixels, -1, 0))


def _in_blocks(function, start, used, *inputs):
    """Run `function(block of each input) -> block of each output` over the first `used` chunks and put the blocks
    into `start`. Inputs and outputs are pairs of an array and its axis of chunks; an axis None means shared by all.

    A loop with as many turns as there are chunks in use: buffers may be roomy at no cost, and a block's carry stays
    in the cache.
    """
    capacity = start[0][0].shape[start[0][1]]
    block = math.gcd(capacity, BLOCK)

    def turn(index, outputs):
        first = index * block
        parts = [x if axis is None else jax.lax.dynamic_slice_in_dim(x, first, block, axis) for x, axis in inputs]
        results = function(*parts)
        placed = zip(outputs, results, start, strict=True)
        return tuple(jax.lax.dynamic_update_slice_in_dim(out, new, first, axis) for out, new, (_, axis) in placed)

    turns = (jnp.minimum(used, capacity) + block - 1) // block
    return jax.lax.fori_loop(0, turns, turn, tuple(x for x, _ in start))


def _chunk_axis(pixels):
    """Axis of `pixels` (c or 1, p, k) that runs over chunks: None where all share the same."""
    return None if pixels.shape[0] == 1 else 0


def _forward_scan(rows, pixels, used):
    """Transmittance (c, p) and weighted values (c, p, v) of each chunk alone."""
    first_value = _first_value(pixels.shape[-1])
    count, chunks, area = rows.shape[1] - first_value, rows.shape[2], pixels.shape[1]

    def block(rows, pixels):
        planes = _planes(pixels)
        shape = (rows.shape[2], area)

        def step(carry, row):
            through, sums = carry
            weight = _alpha(row, planes)[2] * through
            sums = tuple(s + weight * row[first_value + i][:, None] for i, s in enumerate(sums))
            return (through - weight, sums), None

        start = (jnp.ones(shape), tuple(jnp.zeros(shape) for _ in range(count)))
        (through, sums), _ = jax.lax.scan(step, start, rows)
        return through, jnp.stack(sums, axis=-1)

    start = ((jnp.ones((chunks, area)), 0), (jnp.zeros((chunks, area, count)), 0))
    return _in_blocks(block, start, used, (rows, 2), (pixels, _chunk_axis(pixels)))


def _along_tile(operator, values, rank):
    """Inclusive scan of `values` (c, p) by `operator` over each tile's chunks, whose places in their tile are `rank`
    (c,). Hillis and Steele's doubling, in as many turns as the longest list calls for; lax.associative_scan says the
    same in 10 times the compilation time."""

    def double(state):
        shift, values = state
        joined = operator(jnp.roll(values, shift, axis=0), values)
        return shift * 2, jnp.where((rank >= shift)[:, None], joined, values)

    longest = jnp.max(rank)
    return jax.lax.while_loop(lambda state: state[0] <= longest, double, (jnp.int32(1), values))[1]


def _before(through, rank):
    """Exclusive product of `through` (c, p) over a tile's earlier chunks."""
    product = jnp.roll(_along_tile(jnp.multiply, through, rank), 1, axis=0)
    return jnp.where((rank == 0)[:, None], 1.0, product)


@partial(jax.custom_vjp, nondiff_argnums=(4,))
def composite(rows: jax.Array, pixels: jax.Array, chunk_tile: jax.Array, rank: jax.Array, tiles: int):
    """rows (l, m, c) of `gather_rows`, pixels (c or 1, p, k) relative to the anchors -> image (tiles, p, v + 1):
    the weighted values and, last, alpha = 1 - transmittance. Differentiable in `rows` only."""
    return _composite_forward(rows, pixels, chunk_tile, rank, tiles)[0]


def _composite_forward(rows, pixels, chunk_tile, rank, tiles):
    through, sums = _forward_scan(rows, pixels, jnp.sum(chunk_tile < tiles))
    before = _before(through, rank)
    layers = jnp.concatenate([sums, 1.0 - through[..., None]], axis=-1) * before[..., None]
    image = jax.ops.segment_sum(layers, chunk_tile, num_segments=tiles + 1, indices_are_sorted=True)[:tiles]
    return image, (rows, pixels, chunk_tile, rank, before, layers, image)


def _composite_backward(tiles, residuals, gradient):
    """d L / d alpha_i = T_i (value_i . g) - (sum_{j>i} w_j value_j . g) / (1 - alpha_i), with alpha's own
    channel counted as a value of 1. `rest` carries the sum still behind, this one included."""
    rows, pixels, chunk_tile, rank, before, layers, image = residuals
    first_value = _first_value(pixels.shape[-1])
    count = rows.shape[1] - first_value
    pulls = jnp.concatenate([gradient, jnp.zeros_like(gradient[:1])])[chunk_tile]
    total = jnp.concatenate([jnp.sum(gradient * image, axis=-1), jnp.zeros_like(gradient[:1, :, 0])])[chunk_tile]
    here = jnp.sum(layers * pulls, axis=-1)
    rest = total - (_along_tile(jnp.add, here, rank) - here)

    def block(rows, pixels, before, rest, pulls):
        planes, g = _planes(pixels), _planes(pulls)

        def step(carry, row):
            through, rest = carry
            white, raw, alpha = _alpha(row, planes)
            weight = alpha * through
            seen = sum((row[first_value + i][:, None] * g[i] for i in range(count)), g[count])
            rest = rest - weight * seen
            slope = through * seen - rest / (1.0 - alpha)
            # The cut and the clamp are flat: no gradient passes there.
            power = jnp.where((raw >= ALPHA_CUT) & (raw <= ALPHA_MAX), slope * raw, 0.0)
            offsets = [-power * w for w in white]
            sums = [*offsets, *(offset * x for offset in offsets for x in planes), power]
            sums += [weight * g[i] for i in range(count)]
            return (through - weight, rest), jnp.stack([jnp.sum(s, axis=-1) for s in sums])

        return (jax.lax.scan(step, (before, rest), rows)[1],)

    inputs = ((rows, 2), (pixels, _chunk_axis(pixels)), (before, 0), (rest, 0), (pulls, 0))
    (grads,) = _in_blocks(block, ((jnp.zeros_like(rows), 2),), jnp.sum(chunk_tile < tiles), *inputs)
    return grads, None, None, None


composite.defvjp(_composite_forward, _composite_backward)


def composite_chunks(splats, chunks: Chunks, tile_features: jax.Array) -> jax.Array:
    """Splats (project.Splats), their chunks and the tiles' pixel features (tiles, p, k) -> (tiles, p, 5):
    premultiplied rgb, distance x weight, alpha."""
    tiles = tile_features.shape[0]
    values = jnp.concatenate([splats.rgb, splats.distance[:, None]], axis=-1)
    centres = jnp.mean(tile_features, axis=1)
    tile = jnp.minimum(chunks.tile, tiles - 1)
    if tile_features.shape[-1] == 2:  # a flat image: every tile has the first one's pixels about its centre
        # From the first pixel, since the mean of a tile that sticks out of the image is not its centre.
        centres = tile_features[:, 0] + (centres[0] - tile_features[0, 0])
        pixels = (tile_features[0] - centres[0])[None]
    else:
        pixels = (tile_features - centres[:, None])[tile]
    rows = gather_rows(splats.mean, splats.axes, splats.log_opacity, values, chunks.ids, centres[tile])
    return composite(rows, pixels, chunks.tile, chunks.rank, tiles)
