"""Sums over rectangles of pixels that say how well a plane (a value linear in row and column) fits what is inside.

They join like those of Chan, Golub and LeVeque (1983): differences of means only, so that float32 keeps residuals far
below the values themselves.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.resample import pad_sphere


class Moments(NamedTuple):
    """Of rectangles of equal size, (rows, columns, channels) of them."""

    mean: jax.Array
    across: jax.Array  # sum of (column - middle) * value
    down: jax.Array  # sum of (row - middle) * value
    spread: jax.Array  # sum of (value - mean)^2


def of_pixels(values: jax.Array) -> Moments:
    """(h, w, channels) -> rectangles of one pixel."""
    none = jnp.zeros_like(values)
    return Moments(values, none, none, none)


def joined(a: Moments, b: Moments, axis: int, sizes: tuple[int, int], step: float) -> Moments:
    """Of both rectangles as one: b follows a along `axis` (0 down, 1 across), middles `step` pixels apart; `sizes` are
    their pixels."""
    first, second = sizes
    total, shared = first + second, first * second / (first + second)
    rise = b.mean - a.mean
    across, down, lean = a.across + b.across, a.down + b.down, shared * step * rise
    mean, spread = (first * a.mean + second * b.mean) / total, a.spread + b.spread + shared * rise**2
    return Moments(mean, across + lean, down, spread) if axis else Moments(mean, across, down + lean, spread)


def halves(x: jax.Array, axis: int) -> tuple[jax.Array, jax.Array]:
    """The even and the odd ones along `axis`."""
    return (x[:, 0::2], x[:, 1::2]) if axis else (x[0::2], x[1::2])


def paired(cells: Moments, axis: int, shape: tuple[int, int]) -> Moments:
    """Of twice as long rectangles, from those of `shape` (rows, columns of pixels)."""
    a, b = (Moments(*part) for part in zip(*(halves(x, axis) for x in cells), strict=True))
    size = shape[0] * shape[1]
    return joined(a, b, axis, (size, size), shape[axis])


def with_neighbours(cells: Moments, shape: tuple[int, int]) -> tuple[Moments, tuple[int, int]]:
    """Of each rectangle and the ones beside it, along those axes on which it is longer than a pixel; and their shape.
    Beyond a pole lies the other side of the sphere, where right is left and down is up."""
    rows = cells.mean.shape[0]
    beyond = (jnp.arange(rows + 2) == 0) | (jnp.arange(rows + 2) == rows + 1)
    mean, across, down, spread = (pad_sphere(x, 1) for x in cells)
    turned = jnp.where(beyond, -1.0, 1.0)[:, None, None]
    cells = Moments(mean, across * turned, down * turned, spread)
    shape = list(shape)
    for axis in (0, 1):
        before, here, after = (Moments(*x) for x in zip(*(_three(x, axis) for x in cells), strict=True))
        side, size = shape[axis], shape[0] * shape[1]
        if side == 1:
            cells = here
            continue
        pair = joined(before, here, axis, (size, size), side)
        cells = joined(pair, after, axis, (2 * size, size), 1.5 * side)
        shape[axis] = 3 * side
    return cells, tuple(shape)


def _three(x: jax.Array, axis: int) -> list[jax.Array]:
    inner = x.shape[axis] - 2
    return [jax.lax.slice_in_dim(x, start, start + inner, axis=axis) for start in range(3)]


def residual(cells: Moments, shape: tuple[int, int]) -> tuple[jax.Array, jax.Array]:
    """(mean square that the plane of best fit leaves, mean square that its tilt explains) of rectangles of `shape`."""
    rows, columns = shape
    size = rows * columns
    tilt = cells.across**2 * (12 / (size * max(columns**2 - 1, 1)))  # sum of (column - middle)^2 = size (n^2 - 1) / 12
    tilt += cells.down**2 * (12 / (size * max(rows**2 - 1, 1)))
    return jnp.maximum(cells.spread - tilt, 0) / size, tilt / size
