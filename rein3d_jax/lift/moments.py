"""Sums over rectangles of pixels that say how well a plane (a value linear in row and column) fits what is inside.

They join like those of Chan, Golub and LeVeque (1983): differences of means only, so that float32 keeps residuals far
below the values themselves.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.resample import pad_sphere


class PlaneMoments(NamedTuple):
    """Sums over rectangles of equal size, (rows, columns, channels) of them."""

    mean: jax.Array
    across: jax.Array  # sum of (column - middle) * value
    down: jax.Array  # sum of (row - middle) * value
    spread: jax.Array  # sum of (value - mean)^2


def of_pixels(values: jax.Array) -> PlaneMoments:
    """Moments of rectangles of one pixel, from values (h, w, channels)."""
    none = jnp.zeros_like(values)
    return PlaneMoments(values, none, none, none)


def join_moments(a: PlaneMoments, b: PlaneMoments, axis: int, sizes: tuple[int, int], step: float) -> PlaneMoments:
    """Moments of both rectangles as one: b follows a along `axis` (0 down, 1 across), middles `step` pixels apart;
    `sizes` are their pixels."""
    first, second = sizes
    total, shared = first + second, first * second / (first + second)
    rise = b.mean - a.mean
    across, down, lean = a.across + b.across, a.down + b.down, shared * step * rise
    mean, spread = (first * a.mean + second * b.mean) / total, a.spread + b.spread + shared * rise**2
    return PlaneMoments(mean, across + lean, down, spread) if axis else PlaneMoments(mean, across, down + lean, spread)


def halves(x: jax.Array, axis: int) -> tuple[jax.Array, jax.Array]:
    """The even and the odd ones along `axis`."""
    return (x[:, 0::2], x[:, 1::2]) if axis else (x[0::2], x[1::2])


def paired(cells: PlaneMoments, axis: int, shape: tuple[int, int]) -> PlaneMoments:
    """Moments of rectangles twice as long along `axis`, from those of `shape` (rows, columns of pixels)."""
    a, b = (PlaneMoments(*part) for part in zip(*(halves(x, axis) for x in cells), strict=True))
    size = shape[0] * shape[1]
    return join_moments(a, b, axis, (size, size), shape[axis])


def with_neighbours(cells: PlaneMoments, shape: tuple[int, int]) -> tuple[PlaneMoments, tuple[int, int]]:
    """Moments of each rectangle with the ones beside it, along those axes on which it is longer than a pixel; and their
    shape.
    Beyond a pole lies the other side of the sphere, where right is left and down is up."""
    rows = cells.mean.shape[0]
    beyond = (jnp.arange(rows + 2) == 0) | (jnp.arange(rows + 2) == rows + 1)
    mean, across, down, spread = (pad_sphere(x, 1) for x in cells)
    sign = jnp.where(beyond, -1.0, 1.0)[:, None, None]
    cells = PlaneMoments(mean, across * sign, down * sign, spread)
    shape = list(shape)
    for axis in (0, 1):
        before, here, after = (PlaneMoments(*x) for x in zip(*(_three(x, axis) for x in cells), strict=True))
        side, size = shape[axis], shape[0] * shape[1]
        if side == 1:
            cells = here
            continue
        pair = join_moments(before, here, axis, (size, size), side)
        cells = join_moments(pair, after, axis, (2 * size, size), 1.5 * side)
        shape[axis] = 3 * side
    return cells, tuple(shape)


def _three(x: jax.Array, axis: int) -> list[jax.Array]:
    inner = x.shape[axis] - 2
    return [jax.lax.slice_in_dim(x, start, start + inner, axis=axis) for start in range(3)]


def plane_residual(cells: PlaneMoments, shape: tuple[int, int]) -> tuple[jax.Array, jax.Array]:
    """Mean squares, of rectangles of `shape`, that the plane of best fit leaves and that its tilt explains."""
    rows, columns = shape
    size = rows * columns
    tilt = cells.across**2 * (12 / (size * max(columns**2 - 1, 1)))  # sum of (column - middle)^2 = size (n^2 - 1) / 12
    tilt += cells.down**2 * (12 / (size * max(rows**2 - 1, 1)))
    return jnp.maximum(cells.spread - tilt, 0) / size, tilt / size
