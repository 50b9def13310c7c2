"""The prototype that the project began with, re-made from its description as a baseline; never shipped.

8 x 8 tiles; everything is projected, then culled, sorted by depth and (stably) by tile; each tile's list is cut into
chunks of 32; one lax.scan over the Gaussians of a chunk, vectorised over chunks x 64 pixels; chunks of a tile joined
front to back; reverse pass front to back with stored prefixes for each chunk and one scatter-add; support is the box
of the 1/255 ellipse. It uses one core (its worker is pinned to one).
"""

from functools import partial

import jax
import jax.numpy as jnp

from benchmarks.engines.engine import Engine
from benchmarks.engines.ours import CONFIG, camera_of, scene_of
from benchmarks.workloads import Workload
from rein3d_jax.conventions import ALPHA_CUT, ALPHA_MAX
from rein3d_jax.rasterize.project import project
from rein3d_jax.scene import Camera, Gaussians

TILE, CHUNK = 8, 32
ONE_CORE = True


def _boxes(splats, camera):
    grid = jnp.array([-(-camera.width // TILE), -(-camera.height // TILE)])
    first = jnp.clip(jnp.floor(splats.box[:, :2] / TILE), 0, grid).astype(jnp.int32)
    last = jnp.clip(jnp.floor(splats.box[:, 2:] / TILE), -1, grid - 1).astype(jnp.int32)
    return first, jnp.where(splats.visible[:, None], jnp.maximum(last - first + 1, 0), 0), grid


def _chunks(splats, camera, pairs: int, chunks: int):
    """Splat ids (chunks, 32), n where empty, and the tile of each chunk."""
    first, size, grid = _boxes(splats, camera)
    tiles, n = grid[0] * grid[1], splats.visible.shape[0]
    order = jnp.argsort(jnp.where(splats.visible, splats.distance, jnp.inf))
    touched = (size[:, 0] * size[:, 1])[order]
    owner = jnp.repeat(jnp.arange(n), touched, total_repeat_length=pairs)
    rank = jnp.arange(pairs) - (jnp.cumsum(touched) - touched)[owner]
    splat = order[owner]
    tile = (first[splat, 1] + rank // size[splat, 0]) * grid[0] + first[splat, 0] + rank % size[splat, 0]
    tile = jnp.where(jnp.arange(pairs) < touched.sum(), tile, tiles)
    by_tile = jnp.argsort(tile, stable=True)
    count = (-(-camera.width // TILE)) * (-(-camera.height // TILE))
    starts = jnp.searchsorted(tile[by_tile], jnp.arange(count + 1))
    length = -(-(starts[1:] - starts[:-1]) // CHUNK)
    tile_of = jnp.repeat(jnp.arange(count), length, total_repeat_length=chunks)
    nth = jnp.arange(chunks) - (jnp.cumsum(length) - length)[tile_of]
    slot = starts[tile_of][:, None] + nth[:, None] * CHUNK + jnp.arange(CHUNK)
    used = (slot < starts[tile_of + 1][:, None]) & (jnp.arange(chunks) < length.sum())[:, None]
    ids = jnp.where(used, splat[by_tile[jnp.minimum(slot, pairs - 1)]], n)
    return ids, jnp.where(jnp.arange(chunks) < length.sum(), tile_of, count), jnp.where(used[:, 0], nth, 0)


def _alpha(row, pixels):
    """Rows (m, c): mean 2, axes 3, log opacity, colour 3; pixels (c, 64, 2)."""
    x, y = pixels[..., 0] - row[0][:, None], pixels[..., 1] - row[1][:, None]
    white_x, white_y = row[2][:, None] * x + row[3][:, None] * y, row[4][:, None] * y
    raw = jnp.exp(row[5][:, None] - 0.5 * (white_x**2 + white_y**2))
    return x, y, white_x, white_y, raw, jnp.where(raw < ALPHA_CUT, 0.0, jnp.minimum(raw, ALPHA_MAX))


@partial(jax.custom_vjp, nondiff_argnums=(4,))
def _composite(rows, pixels, tile, rank, tiles):
    return _forward(rows, pixels, tile, rank, tiles)[0]


def _prefix(through, rank):
    """Product of the earlier chunks' transmittance, tile by tile."""

    def join(a, b):
        return jnp.where(b[1][:, None], b[0], a[0] * b[0]), a[1] | b[1]

    product = jax.lax.associative_scan(join, (through, rank == 0))[0]
    return jnp.where((rank == 0)[:, None], 1.0, jnp.roll(product, 1, axis=0))


def _forward(rows, pixels, tile, rank, tiles):
    shape = pixels.shape[:2]

    def step(carry, row):
        through, colour = carry
        weight = _alpha(row, pixels)[-1] * through
        return (through - weight, [c + weight * row[6 + i][:, None] for i, c in enumerate(colour)]), None

    (through, colour), _ = jax.lax.scan(step, (jnp.ones(shape), [jnp.zeros(shape)] * 3), rows)
    before = _prefix(through, rank)
    layers = jnp.stack([*colour, 1 - through], axis=-1) * before[..., None]
    image = jax.ops.segment_sum(layers, tile, num_segments=tiles + 1, indices_are_sorted=True)[:tiles]
    return image, (rows, pixels, tile, rank, before, layers, image)


def _backward(tiles, residuals, gradient):
    rows, pixels, tile, rank, before, layers, image = residuals
    pull = jnp.take(gradient, tile, axis=0, mode="clip")
    here = jnp.sum(layers * pull, axis=-1)

    def join(a, b):
        return jnp.where(b[1][:, None], b[0], a[0] + b[0]), a[1] | b[1]

    ahead = jax.lax.associative_scan(join, (here, rank == 0))[0] - here
    rest = jnp.take(jnp.sum(gradient * image, axis=-1), tile, axis=0, mode="clip") - ahead

    def step(carry, row):
        through, rest = carry
        x, y, white_x, white_y, raw, alpha = _alpha(row, pixels)
        weight = alpha * through
        seen = sum(row[6 + i][:, None] * pull[..., i] for i in range(3)) + pull[..., 3]
        rest = rest - weight * seen
        power = jnp.where((raw >= ALPHA_CUT) & (raw <= ALPHA_MAX), (through * seen - rest / (1 - alpha)) * raw, 0.0)
        of_x, of_y = power * white_x, power * white_y
        sums = [of_x, of_y, of_x * x, of_x * y, of_y * y, power, *(weight * pull[..., i] for i in range(3))]
        wx, wy, *others = [jnp.sum(s, axis=-1) for s in sums]
        mean = [row[2] * wx, row[3] * wx + row[4] * wy]
        return (through - weight, rest), jnp.stack([*mean, *(-o for o in others[:3]), *others[3:]])

    return jax.lax.scan(step, (before, rest), rows)[1], None, None, None


_composite.defvjp(_forward, _backward)


def render(gaussians: Gaussians, camera: Camera, pairs: int, chunks: int) -> jax.Array:
    """(h, w, 3) over black; buffers must suffice."""
    splats = project(gaussians, camera, config=CONFIG)
    ids, tile, rank = _chunks(jax.lax.stop_gradient(splats), camera, pairs, chunks)
    axes = splats.axes
    columns = [*splats.mean.T, axes[:, 0, 0], axes[:, 0, 1], axes[:, 1, 1], splats.log_opacity, *splats.rgb.T]
    table = jnp.stack(columns, axis=-1)
    table = jnp.concatenate([table, jnp.zeros_like(table[:1]).at[0, 5].set(-100.0)])
    across, down = -(-camera.width // TILE), -(-camera.height // TILE)
    v, u = jnp.meshgrid(jnp.arange(TILE) + 0.5, jnp.arange(TILE) + 0.5, indexing="ij")
    corner = jnp.stack([tile % across, tile // across], axis=-1) * TILE
    pixels = corner[:, None] + jnp.stack([u.ravel(), v.ravel()], axis=-1)
    image = _composite(jnp.moveaxis(table[ids], 0, -1), pixels, tile, rank, across * down)
    image = image[..., :3].reshape(down, across, TILE, TILE, 3).transpose(0, 2, 1, 3, 4)
    return image.reshape(down * TILE, across * TILE, 3)[: camera.height, : camera.width]


def build(workload: Workload) -> Engine:
    """Buffers of exactly the size that the workload needs: the prototype's best case."""
    scene, camera, target = scene_of(workload), camera_of(workload), jnp.asarray(workload.target)
    _, size, grid = _boxes(jax.jit(lambda g: project(g, camera, config=CONFIG))(scene), camera)
    pairs = int(jnp.sum(size[:, 0] * size[:, 1]))
    chunks = pairs // CHUNK + int(grid[0] * grid[1])  # each tile wastes less than one
    draw = jax.jit(lambda g: render(g, camera, pairs, chunks))

    def loss(floats):
        return jnp.mean((draw(scene.replace(**floats)) - target) ** 2)

    floats = {name: getattr(scene, name) for name in ("means", "log_scales", "quats", "opacity_logits", "sh")}
    gradient = jax.jit(jax.value_and_grad(loss))
    facts = {"pairs": pairs, "evaluations": pairs * TILE**2}
    return Engine(lambda: draw(scene), lambda: gradient(floats), jax.block_until_ready, facts)
