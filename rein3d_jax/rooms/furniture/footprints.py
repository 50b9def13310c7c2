"""Where things stand: upright prisms over rectangles, and whether two of them share space."""

import functools

import jax
import jax.numpy as jnp
from flax import struct


@struct.dataclass
class Footprint:
    """A rectangle on the floor plan, from one height to another."""

    centre: jax.Array  # (..., 2) metres
    half: jax.Array  # (..., 2) metres
    heading: jax.Array  # (..., 2) cosine and sine of the angle it is yawed LEFT
    heights: jax.Array  # (..., 2) metres above the floor, from and to


NOWHERE = -1000.0  # metres: where unused things lie
_einsum = functools.partial(jnp.einsum, precision="highest")


def _axes(a: Footprint) -> jax.Array:
    """(..., 2, 2): rows are the rectangle's own unit axes."""
    c, s = a.heading[..., 0], a.heading[..., 1]
    return jnp.stack([jnp.stack([c, s], -1), jnp.stack([-s, c], -1)], -2)


def footprints_overlap(a: Footprint, b: Footprint) -> jax.Array:
    """Whether two prisms share space; leading axes broadcast. Touching is not sharing. Separating axes: two rectangles
    are apart exactly if they are apart along one of their own four axes."""
    own = [_axes(a), _axes(b)]
    between = b.centre - a.centre
    apart = (a.heights[..., 1] <= b.heights[..., 0]) | (b.heights[..., 1] <= a.heights[..., 0])
    for axes in own:
        halves = [
            _einsum("...j,...ij->...i", x.half, jnp.abs(_einsum("...ik,...jk->...ij", axes, y)))
            for x, y in zip((a, b), own, strict=True)
        ]
        apart |= jnp.any(jnp.abs(_einsum("...ij,...j->...i", axes, between)) >= sum(halves), axis=-1)
    return ~apart


def corners(a: Footprint) -> jax.Array:
    """Corners (..., 4, 2) in metres."""
    signs = jnp.array([[1.0, 1.0], [1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0]])
    offsets = signs * a.half[..., None, :]
    return a.centre[..., None, :] + _einsum("...ki,...ij->...kj", offsets, _axes(a))


def distance_from_origin(a: Footprint) -> jax.Array:
    """Metres on the floor plan from the origin to the rectangle; 0 inside."""
    own = _einsum("...ij,...j->...i", _axes(a), -a.centre)
    return jnp.linalg.norm(jnp.maximum(jnp.abs(own) - a.half, 0), axis=-1)


def upright_box(low: jax.Array, high: jax.Array, floor: jax.Array) -> Footprint:
    """The footprint of boxes along the axes with corners (..., 3) metres."""
    centre, half = (low + high) / 2, jnp.abs(high - low) / 2
    heading = jnp.broadcast_to(jnp.array([1.0, 0.0]), centre[..., :2].shape)
    return Footprint(centre[..., :2], half[..., :2], heading, jnp.stack([low[..., 2], high[..., 2]], -1) - floor)


def join_footprints(*parts: Footprint) -> Footprint:
    """All rows of `parts`."""
    return jax.tree.map(lambda *rows: jnp.concatenate(rows), *parts)
