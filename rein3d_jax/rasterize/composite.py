"""Front-to-back compositing of chunked splats, with its own reverse pass.

    w_i = alpha_i T_i,   T_{i+1} = T_i (1 - alpha_i),   image = sum_i w_i value_i     (Kerbl et al. 2023, eq. 3)

A chunk is a loop over its Gaussians, vectorised over chunks x pixels with the pixels innermost, unrolled by a few
Gaussians: the carry then travels to the cache less often. A step gathers its Gaussians' numbers itself, so that nothing
is stored for a (Gaussian, tile) pair but its index. Chunks of a tile join by the associative "over". The reverse pass
walks front to back too, with the weighted sum still to come as its carry, so nothing per evaluation is stored and
nothing is divided by a small transmittance; its sums over pixels are products with the pixels' monomials. What each
of these gains is in benchmarks/README.md.
"""

import math

import jax
import jax.numpy as jnp

from rein3d_jax.conventions import ALPHA_CUT, ALPHA_MAX
from rein3d_jax.rasterize.pixels import tile_pixels
from rein3d_jax.rasterize.project import Splats
from rein3d_jax.rasterize.quadratic import axes_entries, coefficients, evaluate_quadratic, monomials, terms
from rein3d_jax.rasterize.tile import Chunks
from rein3d_jax.scene import Camera

_BLOCK = 512  # chunks handled at a time: their carry fits a core's second-level cache
_UNROLL = 4  # Gaussians a step of the loop
_EMPTY = -100.0  # log opacity of a slot without a Gaussian: alpha 0


def splat_table(splats: Splats, values: jax.Array) -> jax.Array:
    """All that compositing reads of splats with values (n, v), and an empty one: (n + 1, m). A row is the mean, the
    stored entries of the axes, the log opacity, the values."""
    k = splats.mean.shape[1]
    axes = [splats.axes[:, i, j] for i, j in axes_entries(k)]
    table = jnp.stack([*splats.mean.T, *axes, splats.log_opacity, *values.T], axis=-1)
    return jnp.concatenate([table, jnp.zeros_like(table[:1]).at[0, k + len(axes)].set(_EMPTY)])


def _unpack(rows: jax.Array, anchors: jax.Array) -> tuple[list, list]:
    """Rows (u, b, m) of the table, the chunks' anchors (b, k) -> terms(k) coefficients and v values, each (u, b)."""
    k = anchors.shape[1]
    entries, columns = axes_entries(k), list(jnp.moveaxis(rows, -1, 0))
    offset = [anchor - mean for anchor, mean in zip(anchors.T, columns[:k], strict=True)]
    axes = dict(zip(entries, columns[k:], strict=False))
    log_opacity, *values = columns[k + len(entries) :]
    return coefficients(offset, axes, log_opacity), values


def _alpha(row, planes):
    """Coefficients (terms(k) x (b,)), pixels k x (b or 1, p) -> raw and cut, clamped alpha (b, p)."""
    raw = jnp.exp(evaluate_quadratic([c[:, None] for c in row], planes))
    return raw, jnp.where(raw < ALPHA_CUT, 0.0, jnp.minimum(raw, ALPHA_MAX))


class _Blocks:
    """The chunks in use, block by block. Loops have as many steps as there are chunks and Gaussians: buffers may be
    roomy at no cost."""

    def __init__(self, chunks: Chunks, anchors: jax.Array, pixels: jax.Array):
        length, capacity = chunks.ids.shape
        self.chunks, self.anchors, self.pixels = chunks, anchors, pixels
        self.block, self.unroll = math.gcd(capacity, _BLOCK), math.gcd(length, _UNROLL)
        self.count = -(-jnp.sum(chunks.fill > 0) // self.block)

    def part(self, x: jax.Array, index) -> jax.Array:
        """The block's rows of x (c, ...)."""
        return jax.lax.dynamic_slice_in_dim(x, index * self.block, self.block)

    def by_tile(self, x: jax.Array, index) -> jax.Array:
        """The rows of x (tiles, ...) that belong to the block's chunks."""
        return jnp.take(x, self.part(self.chunks.tile, index), axis=0, mode="clip")

    def planes(self, index) -> list[jax.Array]:
        """Pixel offsets of the block: k arrays (block, p), or (1, p) where all tiles have the same."""
        pixels = self.pixels if self.pixels.shape[0] == 1 else self.by_tile(self.pixels, index)
        return list(jnp.moveaxis(pixels, 1, 0))

    def steps(self, index) -> jax.Array:
        """As many as the block's first chunk needs, which is its fullest."""
        return -(-self.chunks.fill[index * self.block] // self.unroll)

    def ids(self, index, number) -> jax.Array:
        """Splats (unroll, block) of step `number` of the block."""
        place = (number * self.unroll, index * self.block)
        return jax.lax.dynamic_slice(self.chunks.ids, place, (self.unroll, self.block))


def _chunk_layers(table, anchors, pixels, chunks):
    """Each chunk alone: weighted values and, last, transmittance (c, v + 1, p)."""
    blocks, area = _Blocks(chunks, anchors, pixels), pixels.shape[2]
    values = table.shape[1] - anchors.shape[1] - len(axes_entries(anchors.shape[1])) - 1

    def composite_block(index, layers):
        near, planes = blocks.by_tile(anchors, index), blocks.planes(index)

        def step(number, state):
            through, sums = state
            of_terms, of_values = _unpack(table[blocks.ids(index, number)], near)
            for u in range(blocks.unroll):
                weight = _alpha([c[u] for c in of_terms], planes)[1] * through
                sums = [s + weight * value[u][:, None] for s, value in zip(sums, of_values, strict=True)]
                through = through - weight
            return through, sums

        empty = jnp.zeros((blocks.block, area), table.dtype)
        through, sums = jax.lax.fori_loop(0, blocks.steps(index), step, (empty + 1, [empty] * values))
        return jax.lax.dynamic_update_slice_in_dim(layers, jnp.stack([*sums, through], 1), index * blocks.block, 0)

    start = jnp.zeros((chunks.tile.shape[0], values + 1, area), table.dtype)
    return jax.lax.fori_loop(0, blocks.count, composite_block, start)


def _along_tile(operator, values, rank):
    """Inclusive scan of `values` (c, p), listed by tile, by `operator` over each tile's chunks, whose places in their
    tile are `rank` (c,). Hillis and Steele's doubling, in as many steps as the longest list calls for;
    lax.associative_scan says the same in 10 times the compilation time."""

    def double(state):
        shift, values = state
        joined = operator(jnp.roll(values, shift, axis=0), values)
        return shift * 2, jnp.where((rank >= shift)[:, None], joined, values)

    longest = jnp.max(rank)
    return jax.lax.while_loop(lambda state: state[0] <= longest, double, (jnp.int32(1), values))[1]


def _before(through, chunks):
    """Product of `through` (c, p) over the earlier chunks of each chunk's tile."""
    product = jnp.roll(_along_tile(jnp.multiply, through[chunks.order], chunks.rank), 1, axis=0)
    return jnp.where((chunks.rank == 0)[:, None], 1.0, product)[chunks.position]


@jax.custom_vjp
def composite(table: jax.Array, anchors: jax.Array, pixels: jax.Array, chunks: Chunks) -> jax.Array:
    """The image (tiles, v + 1, p), weighted values and, last, alpha, of a `splat_table`, anchors (tiles, k) and pixels
    (1 or tiles, k, p) relative to them. Differentiable in `table` only."""
    return _composite_forward(table, anchors, pixels, chunks)[0]


def _composite_forward(table, anchors, pixels, chunks):
    layers, tiles = _chunk_layers(table, anchors, pixels, chunks), anchors.shape[0]
    before = _before(layers[:, -1], chunks)
    layers = layers.at[:, -1].set(1.0 - layers[:, -1]) * before[:, None]
    image = jax.ops.segment_sum(layers, chunks.tile, num_segments=tiles + 1)[:tiles]
    return image, (table, anchors, pixels, chunks, before, layers, image)


def _still_to_come(gradient, layers, image, chunks):
    """What the chunk and those behind it add (c, p) to the loss, sum_i w_i value_i . g."""
    here = jnp.sum(layers * jnp.take(gradient, chunks.tile, axis=0, mode="clip"), axis=1)
    ahead = _along_tile(jnp.add, here[chunks.order], chunks.rank)[chunks.position] - here
    return jnp.take(jnp.sum(gradient * image, axis=1), chunks.tile, axis=0, mode="clip") - ahead


def _moments(power, planes):
    """Sums over pixels of `power` (u, b, p) times each monomial of the planes: terms(k) arrays (u, b)."""
    basis = monomials(planes)
    if planes[0].shape[0] > 1:  # a panorama's tiles differ
        moments = jnp.einsum("ubp,bkp->ubk", power, jnp.stack(basis, axis=1), precision="highest")
    else:
        # Pixels stay innermost on the left: the same product written the other way makes XLA transpose, and took 5 x.
        moments = jnp.einsum("ubp,pk->ubk", power, jnp.concatenate(basis).T, precision="highest")
    return [moments[..., i] for i in range(terms(len(planes)))]


def _composite_backward(residuals, gradient):
    """d L / d alpha_i = T_i (value_i . g) - (sum_{j>i} w_j value_j . g) / (1 - alpha_i), with alpha's own
    channel counted as a value of 1. `rest` carries the sum still behind, this one included."""
    table, anchors, pixels, chunks, before, layers, image = residuals
    rest = _still_to_come(gradient, layers, image, chunks)
    blocks, ones = _Blocks(chunks, anchors, pixels), jnp.ones(pixels.shape[2], table.dtype)

    def reverse_block(index, of_table):
        near, planes = blocks.by_tile(anchors, index), blocks.planes(index)
        pull = list(jnp.moveaxis(blocks.by_tile(gradient, index), 1, 0))

        def step(number, state):
            through, rest, of_table = state
            ids = blocks.ids(index, number)
            (of_terms, of_values), chain = jax.vjp(lambda x: _unpack(x, near), table[ids])
            powers, weights = [], []
            for u in range(blocks.unroll):
                raw, alpha = _alpha([c[u] for c in of_terms], planes)
                weight = alpha * through
                seen = sum((x[u][:, None] * g for x, g in zip(of_values, pull, strict=False)), pull[-1])
                rest = rest - weight * seen
                slope = through * seen - rest / (1.0 - alpha)
                # The cut and the clamp are flat: no gradient passes there.
                powers.append(jnp.where((raw >= ALPHA_CUT) & (raw <= ALPHA_MAX), slope * raw, 0.0))
                weights.append(weight)
                through = through - weight
            weights = jnp.stack(weights)
            sums = [jnp.matmul(weights * g, ones, precision="highest") for g in pull[:-1]]
            (of_rows,) = chain((_moments(jnp.stack(powers), planes), sums))
            # One row after the other on a CPU: the same bytes every time. A GPU adds them atomically unless XLA_FLAGS
            # has --xla_gpu_deterministic_ops=true.
            return through, rest, of_table.at[ids].add(of_rows)

        start = (blocks.part(before, index), blocks.part(rest, index), of_table)
        return jax.lax.fori_loop(0, blocks.steps(index), step, start)[2]

    of_table = jax.lax.fori_loop(0, blocks.count, reverse_block, jnp.zeros_like(table))
    return of_table, None, None, None


composite.defvjp(_composite_forward, _composite_backward)


def composite_chunks(splats: Splats, values, chunks: Chunks, camera: Camera, tile: int) -> jax.Array:
    """Splats with their values (n, v) and chunks -> (tiles, v + 1, tile^2): premultiplied values and, last, alpha."""
    return composite(splat_table(splats, values), *tile_pixels(camera, tile), chunks)
