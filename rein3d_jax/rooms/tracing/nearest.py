"""Which surface each ray meets first: the shell, a recess in it, or a solid inside."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jax import lax

from rein3d_jax.rooms.model import Openings, Room, Solids
from rein3d_jax.rooms.tracing.intersect import meet_box, meet_cylinder, meet_ellipsoid, slab
from rein3d_jax.rooms.tracing.vectors import Vector, components, rotate_right, scale, subtract

SHELL_FACES = 6  # floor, ceiling, walls at +x, +y, -x, -y
# Solids handled in one pass over the pixels: rays are read from memory once for all of them. Measured on 2 cores.
_AT_A_TIME = 8


def over_solids(solids: Solids, count: jax.Array, carry, visit: Callable):
    """The last carry = visit(carry, solid, index) of the first `count` solids, and perhaps a few more; `solid` is a row
    of Solids."""
    capacity = solids.half.shape[0]
    assert capacity % _AT_A_TIME == 0, f"a capacity of {capacity} is no multiple of {_AT_A_TIME}"

    def some(block, carry):
        start = block * _AT_A_TIME
        rows = jax.tree.map(lambda x: lax.dynamic_slice_in_dim(x, start, _AT_A_TIME) if x.ndim else x, solids)
        for i in range(_AT_A_TIME):
            carry = visit(carry, jax.tree.map(lambda x, i=i: x[i] if x.ndim else x, rows), start + i)
        return carry

    return lax.fori_loop(0, (count + _AT_A_TIME - 1) // _AT_A_TIME, some, carry)


def into(solid: Solids, origin: Vector, ray: Vector) -> tuple[Vector, Vector, Vector]:
    """Origin and ray in the axes of a solid, and its half size."""
    heading = cos_sin(solid.heading)
    start = rotate_right(subtract(origin, components(solid.centre)), heading)
    return start, rotate_right(ray, heading), components(solid.half)


def cos_sin(heading: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Cosine and sine (...) of headings (..., 2)."""
    return heading[..., 0], heading[..., 1]


def families(room: Room) -> tuple[tuple[Solids, int], ...]:
    """Boxes, cylinders and ellipsoids, each with the surface index of its first solid."""
    boxes = SHELL_FACES + room.openings.half.shape[0]
    cylinders = boxes + room.boxes.half.shape[0]
    ellipsoids = cylinders + room.cylinders.half.shape[0]
    return (room.boxes, boxes), (room.cylinders, cylinders), (room.ellipsoids, ellipsoids)


def nearest(room: Room, origin: Vector, ray: Vector) -> tuple[jax.Array, jax.Array]:
    """Distance and surface index of the first hit, for origins inside the shell. Surfaces: the six faces, then the
    openings, boxes, cylinders, ellipsoids by slot."""
    carry = _leave_shell(room, origin, ray)
    for index in range(room.openings.half.shape[0]):
        carry = _enter_opening(carry, room.openings, index, origin, ray)
    for (solids, first), meet in zip(families(room), (meet_box, meet_cylinder, meet_ellipsoid), strict=True):

        def visit(carry, solid, index, meet=meet, first=first):
            t = meet(*into(solid, origin, ray))
            return jnp.minimum(t, carry[0]), jnp.where(t < carry[0], first + index, carry[1])

        carry = over_solids(solids, solids.count, carry, visit)
    return carry


def _leave_shell(room: Room, origin: Vector, ray: Vector) -> tuple[jax.Array, jax.Array]:
    distance, face = jnp.full(ray[0].shape, jnp.inf), jnp.zeros(ray[0].shape, jnp.int32)
    for axis, (plus, minus) in enumerate(((2, 4), (3, 5), (1, 0))):
        up = ray[axis] > 0
        along = jnp.where(jnp.abs(ray[axis]) < 1e-9, 1e-9, ray[axis])
        t = (jnp.where(up, room.high[axis], room.low[axis]) - origin[axis]) / along
        t = jnp.where(t < 0, jnp.inf, t)  # along the face, rounding
        face = jnp.where(t < distance, jnp.where(up, plus, minus), face)
        distance = jnp.minimum(distance, t)
    return distance, face


def _enter_opening(carry, openings: Openings, index: int, origin: Vector, ray: Vector):
    """A ray that meets the shell inside the recess's box goes on to the far side of the box."""
    distance, surface = carry
    moved = subtract(origin, components(openings.centre[index]))
    enter, leave = slab(moved, ray, components(openings.half[index]))
    through = (enter < distance) & (distance < leave) & (surface < SHELL_FACES)
    return jnp.where(through, leave, distance), jnp.where(through, SHELL_FACES + index, surface)


def point_at(origin: Vector, ray: Vector, distance: jax.Array) -> Vector:
    """Point origin + distance ray."""
    return tuple(o + d for o, d in zip(origin, scale(ray, distance), strict=True))
