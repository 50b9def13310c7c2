"""A picture cut into rectangles with sides of powers of two: the least cost + price * count of all ways to halve it
again and again across or down, found from the pixels up (dyadic CART, Donoho 1997). The price is what makes the count
fit: a bisection."""

import math
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp

Level = tuple[int, int]  # (log2 of rows, log2 of columns) of a rectangle
_PRICES = (-30.0, 40.0)  # natural logarithms between which the price lies
_BISECTIONS = 40  # the interval then is below float32's steps


class Leaves(NamedTuple):
    """What each pixel belongs to; pixels that were not wanted belong to `capacity`, which is no leaf."""

    label: jax.Array  # (h, w) int, from 0, in the order of the leaves' first pixels
    sides: jax.Array  # (h, w, 2) rows and columns of the pixel's leaf
    count: jax.Array  # () leaves
    missing: jax.Array  # () leaves above capacity: 0 unless even the largest ones are too many


@partial(jax.jit, static_argnames=("capacity", "worth"))
def partition(cost: dict[Level, jax.Array], wanted: jax.Array, capacity: int, worth: float = 0.0) -> Leaves:
    """Leaves of a picture, `capacity` at most, of the least total cost, each leaf counted as `worth` more: a rectangle
    is halved only where that spares so much.

    `cost[j, k]` (h >> j, w >> k) is that of each rectangle of 2^j x 2^k pixels as one leaf, for all j <= J, k <= K.
    `wanted` (h, w): pixels that are to be covered; the costs have to keep the others apart.
    """
    some = {level: _any(wanted, level) for level in cost}

    def narrower(_, prices):
        low, high = prices
        middle = (low + high) / 2
        fits = _plan(cost, some, jnp.exp(middle))[1] <= capacity
        return jnp.where(fits, low, middle), jnp.where(fits, middle, high)

    least, most = _PRICES
    prices = max(least, math.log(worth)) if worth else least, most
    _, high = jax.lax.fori_loop(0, _BISECTIONS, narrower, tuple(map(jnp.float32, prices)))
    return _read(_plan(cost, some, jnp.exp(high))[0], wanted, capacity)


def _any(x: jax.Array, level: Level) -> jax.Array:
    h, w = x.shape
    return x.reshape(h >> level[0], 1 << level[0], w >> level[1], 1 << level[1]).any((1, 3))


def _pair_sum(x: jax.Array, axis: int) -> jax.Array:
    return x[:, 0::2] + x[:, 1::2] if axis else x[0::2] + x[1::2]


def _plan(cost: dict[Level, jax.Array], some: dict[Level, jax.Array], price: jax.Array):
    """The choice for each rectangle (0: a leaf, 1: halved across rows, 2: across columns), and how many leaves in
    all."""
    value, choice, count = {}, {}, {}
    for level in sorted(cost):
        best, number = cost[level] + price * some[level], some[level].astype(jnp.float32)
        chosen = jnp.zeros(best.shape, jnp.int8)
        for axis, below in ((1, (level[0], level[1] - 1)), (0, (level[0] - 1, level[1]))):
            if below in value:
                halved = _pair_sum(value[below], axis)
                better = halved < best
                best, chosen = jnp.where(better, halved, best), jnp.where(better, jnp.int8(1 + axis), chosen)
                number = jnp.where(better, _pair_sum(count[below], axis), number)
        value[level], choice[level], count[level] = best, chosen, number
    return choice, jnp.sum(number)


def _read(choice: dict[Level, jax.Array], wanted: jax.Array, capacity: int) -> Leaves:
    """From the largest rectangles down to the leaves."""
    reached = {level: jnp.full(x.shape, level == max(choice)) for level, x in choice.items()}
    log_sides = jnp.zeros((*wanted.shape, 2), jnp.int32)
    for level in sorted(choice, reverse=True):
        here, chosen = reached[level], choice[level]
        leaf = jnp.repeat(jnp.repeat(here & (chosen == 0), 1 << level[0], axis=0), 1 << level[1], axis=1)
        log_sides = jnp.where(leaf[..., None], jnp.array(level), log_sides)
        for axis, below in ((1, (level[0], level[1] - 1)), (0, (level[0] - 1, level[1]))):
            if below in reached:
                reached[below] |= jnp.repeat(here & (chosen == 1 + axis), 2, axis=axis)
    row, column = jnp.arange(wanted.shape[0])[:, None], jnp.arange(wanted.shape[1])[None]
    first = (row >> log_sides[..., 0] << log_sides[..., 0], column >> log_sides[..., 1] << log_sides[..., 1])
    head = (first[0] == row) & (first[1] == column)
    head &= _wanted_leaf(wanted, first, head)
    label = (jnp.cumsum(head.ravel()).reshape(head.shape) - 1)[first]
    count = jnp.sum(head)
    label = jnp.where(wanted & (label < capacity), label, capacity)
    return Leaves(label, 1 << log_sides, jnp.minimum(count, capacity), jnp.maximum(count - capacity, 0))


def _wanted_leaf(wanted: jax.Array, first: tuple[jax.Array, jax.Array], head: jax.Array) -> jax.Array:
    """Whether any pixel of the leaf that starts here is wanted."""
    return head & jnp.zeros(wanted.shape, bool).at[first].max(wanted)
