"""Where rays meet solids, exactly, and how much of a round lamp a solid hides.

Points and rays are vectors (vectors.py) in a solid's own axes, unscaled; `half` is its half size. A ray
that misses meets the solid at infinity; so does one that starts inside."""

import jax
import jax.numpy as jnp

from rein3d_jax.rooms.tracing.vectors import Vector, dot

_PARALLEL = 1e-9  # a ray this nearly along a face is taken as this steep: it meets the face far outside the room
_CONTACT = 0.004  # metres: no shadow's edge is thinner, so that a surface never shades itself


def slab(origin: Vector, ray: Vector, half: Vector) -> tuple[jax.Array, jax.Array]:
    """Distances along the ray at which it enters and leaves the box [-half, half]; enter > leave is a miss."""
    enter, leave = -jnp.inf, jnp.inf
    for o, d, h in zip(origin, ray, half, strict=True):
        inverse = 1 / jnp.where(jnp.abs(d) < _PARALLEL, _PARALLEL, d)
        middle, length = -o * inverse, jnp.abs(inverse) * h
        enter, leave = jnp.maximum(enter, middle - length), jnp.minimum(leave, middle + length)
    return enter, leave


def meet_box(origin: Vector, ray: Vector, half: Vector) -> jax.Array:
    """Distance to the box."""
    enter, leave = slab(origin, ray, half)
    return jnp.where((enter <= leave) & (enter > 0), enter, jnp.inf)


def meet_ellipsoid(origin: Vector, ray: Vector, half: Vector) -> jax.Array:
    """Distance to the ellipsoid of semi-axes `half`. From the point of closest approach q of the scaled ray:
    t = t_q - sqrt((1 - |q|^2) / |d|^2), which does not cancel for small, distant solids."""
    o, d = _scaled(origin, half), _scaled(ray, half)
    square = dot(d, d)
    closest = -dot(o, d) / square
    q = tuple(a + closest * b for a, b in zip(o, d, strict=True))
    inside = 1 - dot(q, q)
    t = closest - jnp.sqrt(jnp.maximum(inside, 0) / square)
    return jnp.where((inside > 0) & (t > 0), t, jnp.inf)


def meet_cylinder(origin: Vector, ray: Vector, half: Vector) -> jax.Array:
    """Distance to the upright elliptic cylinder: the interval inside the round side, cut by the interval between the
    caps."""
    o, d = _scaled(origin, half), _scaled(ray, half)
    square = jnp.maximum(d[0] * d[0] + d[1] * d[1], _PARALLEL)
    closest = -(o[0] * d[0] + o[1] * d[1]) / square
    x, y = o[0] + closest * d[0], o[1] + closest * d[1]
    inside = 1 - x * x - y * y
    length = jnp.sqrt(jnp.maximum(inside, 0) / square)
    inverse = 1 / jnp.where(jnp.abs(d[2]) < _PARALLEL, _PARALLEL, d[2])
    enter = jnp.maximum(closest - length, -o[2] * inverse - jnp.abs(inverse))
    leave = jnp.minimum(closest + length, -o[2] * inverse + jnp.abs(inverse))
    return jnp.where((inside > 0) & (enter <= leave) & (enter > 0), enter, jnp.inf)


def hide_by_box(origin: Vector, ray: Vector, half: Vector, distance: jax.Array, width: jax.Array) -> jax.Array:
    """Share of a lamp that the box hides; the lamp is `distance` metres away, `width` its radius / distance.

    The ray is judged where it comes nearest to the box (in the middle of its slabs' intervals): by how deep it runs
    inside, or how far outside, relative to the cone from the point to the lamp. Hard at contact, soft far away.
    """
    enter, leave = slab(origin, ray, half)
    middle = 0.5 * (jnp.clip(enter, 0, distance) + jnp.clip(leave, 0, distance))
    outside = -jnp.inf
    for o, d, h in zip(origin, ray, half, strict=True):
        outside = jnp.maximum(outside, jnp.abs(o + middle * d) - h)
    return _share(outside, middle, width)


def hide_by_ellipsoid(origin: Vector, ray: Vector, half: Vector, distance: jax.Array, width: jax.Array) -> jax.Array:
    """As hide_by_box, judged at the closest approach of the scaled ray."""
    o, d = _scaled(origin, half), _scaled(ray, half)
    middle = jnp.clip(-dot(o, d) / dot(d, d), 0, distance)
    q = tuple(a + middle * b for a, b in zip(o, d, strict=True))
    size = jnp.minimum(jnp.minimum(half[0], half[1]), half[2])
    return _share((jnp.sqrt(dot(q, q)) - 1) * size, middle, width)


def hide_by_cylinder(origin: Vector, ray: Vector, half: Vector, distance: jax.Array, width: jax.Array) -> jax.Array:
    """As hide_by_box, judged where the ray comes nearest to the axis between the caps."""
    o, d = _scaled(origin, half), _scaled(ray, half)
    closest = -(o[0] * d[0] + o[1] * d[1]) / jnp.maximum(d[0] * d[0] + d[1] * d[1], _PARALLEL)
    inverse = 1 / jnp.where(jnp.abs(d[2]) < _PARALLEL, _PARALLEL, d[2])
    below, above = -o[2] * inverse - jnp.abs(inverse), -o[2] * inverse + jnp.abs(inverse)
    middle = jnp.clip(jnp.clip(closest, below, above), 0, distance)
    x, y, z = (a + middle * b for a, b in zip(o, d, strict=True))
    round_side = (jnp.sqrt(x * x + y * y) - 1) * jnp.minimum(half[0], half[1])
    return _share(jnp.maximum(round_side, (jnp.abs(z) - 1) * half[2]), middle, width)


def _share(outside: jax.Array, along: jax.Array, width: jax.Array) -> jax.Array:
    """1 where the ray runs deep inside, 0 far outside, smooth across the lamp's cone."""
    x = jnp.clip(0.5 - 0.5 * outside / (along * width + _CONTACT), 0, 1)
    return x * x * (3 - 2 * x)


def _scaled(a: Vector, half: Vector) -> Vector:
    return a[0] * (1 / half[0]), a[1] * (1 / half[1]), a[2] * (1 / half[2])
