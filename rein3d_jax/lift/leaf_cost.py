"""What it costs to show a rectangle of pixels as one Gaussian: how far the picture is from one colour, there and where
the Gaussian's flanks reach. Rectangles that no Gaussian may span cost more than any other way to cover them."""

from functools import partial

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.resample import pad_sphere
from rein3d_jax.geometry.sphere import latitudes
from rein3d_jax.lift.config import LiftConfig
from rein3d_jax.lift.moments import halves, of_pixels, paired, plane_residual, with_neighbours
from rein3d_jax.lift.partition import Level
from rein3d_jax.lift.surface import beside_steps

_FORBIDDEN = 1e3  # colour costs stay below sqrt(3) a pixel
_TILT = 0.08  # of a linear gradient's mean square that counts: neighbours that overlap show most of it between them
_FLOOR = 1e-12  # of a mean square: leaves the square root's neighbourhood of 0 its order


def leaf_costs(rgb: jax.Array, distance: jax.Array, wanted: jax.Array, *, config: LiftConfig) -> dict[Level, jax.Array]:
    """The costs for `partition`, of every leaf up to config.max_leaf_side pixels a side: pixels times the root of the
    mean square. Not to be spanned: steps of distance, bent surfaces, pixels that are not `wanted` (h, w)."""
    height, width = distance.shape
    cells = {(0, 0): _pixels(rgb, distance, wanted, config)}
    costs = {(0, 0): jnp.zeros(distance.shape)}
    for level in levels_of(height, width, config.max_leaf_side)[1:]:
        below = (level[0], level[1] - 1) if level[1] else (level[0] - 1, 0)
        cells[level], costs[level] = _level(cells[below], level, config)
    return costs


@partial(jax.jit, static_argnums=3)
def _pixels(rgb: jax.Array, distance: jax.Array, wanted: jax.Array, config: LiftConfig):
    """PlaneMoments of colour and inverse distance, what no leaf may span, and area, of each pixel."""
    apart = ~wanted | beside_steps(1 / distance, config.leaf_step)
    area = jnp.broadcast_to(jnp.cos(latitudes(len(rgb)))[:, None], distance.shape)
    return of_pixels(jnp.concatenate([rgb, 1 / distance[..., None]], axis=-1)), apart, area


@partial(jax.jit, static_argnums=(1, 2))
def _level(below, level: Level, config: LiftConfig):
    """The same of `level`'s cells, and their costs, from cells of half the width, or height where they are one wide."""
    axis = 1 if level[1] else 0
    shape = (1 << level[0], 1 << level[1])
    half = (shape[0], shape[1] // 2) if axis else (shape[0] // 2, shape[1])
    moments, apart, area = below
    apart, area = (halves(x, axis) for x in (apart, area))
    cells = paired(moments, axis, half), apart[0] | apart[1], area[0] + area[1]
    return cells, _cost(*cells, shape, config)


def largest_side(pixels: int, largest: int) -> int:
    """The longest side of leaves along a side of so many pixels: a power of 2 that divides it. An eighth of a circle at
    most: what is wider has no plane that the sphere is near to."""
    most = max(min(largest, pixels // 8), 1)
    return max(1 << k for k in range(most.bit_length()) if pixels % (1 << k) == 0)


def levels_of(height: int, width: int, largest: int) -> list[Level]:
    """Rectangles that may become one Gaussian, smallest first."""
    most = [largest_side(side, largest).bit_length() - 1 for side in (height, width)]
    return [(j, k) for j in range(most[0] + 1) for k in range(most[1] + 1)]


def _cost(moments, apart: jax.Array, area: jax.Array, shape: tuple[int, int], config: LiftConfig) -> jax.Array:
    wide, window = with_neighbours(moments, shape)
    rest, tilt = plane_residual(wide, window)
    bend = jnp.sqrt(rest[..., 3]) / moments.mean[..., 3]
    colour = jnp.sum((rest + _TILT * tilt)[..., :3], axis=-1)
    forbidden = (bend > config.flatness) | _touching(apart, shape)
    return area * jnp.sqrt(colour + _FLOOR) + _FORBIDDEN * shape[0] * shape[1] * forbidden


def _touching(apart: jax.Array, shape: tuple[int, int]) -> jax.Array:
    """Of cells, whether one or a neighbour is marked; beside sides of one pixel there are no neighbours."""
    near = pad_sphere(apart, 1)
    near = near[:-2] | near[1:-1] | near[2:] if shape[0] > 1 else near[1:-1]
    return near[:, :-2] | near[:, 1:-1] | near[:, 2:] if shape[1] > 1 else near[:, 1:-1]
