"""Light at each hit: lamps and windows with soft shadows, and what the room itself reflects back."""

import jax
import jax.numpy as jnp

from rein3d_jax.rooms.model import Room, Textures
from rein3d_jax.rooms.tracing.intersect import hide_by_box, hide_by_cylinder, hide_by_ellipsoid
from rein3d_jax.rooms.tracing.nearest import families, into, over_solids
from rein3d_jax.rooms.tracing.surface import SurfaceHits
from rein3d_jax.rooms.tracing.vectors import Vector, add, components, dot, scale, subtract

_LIFT = 0.006  # metres off the surface, where shadow rays start
_NEARBY = 0.4  # metres: what of a solid darkens the ambient light at a point is its nearest ball of this radius at most
_CORNER = 1.0  # metres from a wall at which it has ceased to darken the ambient light
_CORNER_DEPTH = 0.5  # share of the ambient light that a corner of the shell loses per wall


def gather_texture(textures: Textures, row: jax.Array) -> dict:
    """The texture of every pixel: arrays of the pixels' shape, in tuples where model.Textures has more axes."""

    def take(column):
        return column[row] if column.ndim == 1 else tuple(take(column[:, i]) for i in range(column.shape[1]))

    return {name: take(getattr(textures, name)) for name in textures.__dataclass_fields__}


def irradiance(room: Room, hits: SurfaceHits) -> Vector:
    """Linear light that falls on each hit, per channel."""
    start = add(hits.point, scale(hits.normal, _LIFT))
    beams = [_beam(room, k, start, hits.normal) for k in range(room.lights.radius.shape[0])]
    passed, open_sky = _unhidden(room, hits, start, beams)
    total = _ambient(room, hits, open_sky)
    for k, (strength, *_) in enumerate(beams):
        light = strength * passed[k]
        total = tuple(e + light * p for e, p in zip(total, components(room.lights.power[k]), strict=True))
    return total


def _beam(room: Room, k: int, start: Vector, normal: Vector):
    """Light k unshadowed: (strength, unit ray to it, distance, radius / distance)."""
    lights = room.lights
    away = subtract(components(lights.position[k]), start)
    square = dot(away, away)
    inverse = jax.lax.rsqrt(square)
    ray = scale(away, inverse)
    towards = jnp.maximum(dot(ray, normal), 0)
    cosine = jnp.maximum(-dot(ray, components(lights.axis[k])), 0)
    strength = towards * (lights.spread[k] + (1 - lights.spread[k]) * cosine)
    strength = strength / (square + lights.radius[k] ** 2)
    return strength, ray, square * inverse, lights.radius[k] * inverse


def _unhidden(room: Room, hits: SurfaceHits, start: Vector, beams: list) -> tuple[tuple, jax.Array]:
    """Share of each light that passes all solids, and of the ambient light."""
    one = jnp.ones(hits.index.shape)
    carry = (tuple(one for _ in beams), one)
    for (solids, _), hide in zip(families(room), (hide_by_box, hide_by_cylinder, hide_by_ellipsoid), strict=True):

        def visit(carry, solid, index, hide=hide, casters=solids.casters):
            passed, open_sky = carry
            opacity = jnp.where(index < casters, 1.0, 0.0)
            left = []
            for share, (_, ray, distance, width) in zip(passed, beams, strict=True):
                hidden = hide(*into(solid, start, ray), distance, width)
                left.append(share * (1 - opacity * hidden))
            return tuple(left), open_sky * (1 - opacity * _covers(solid, start, hits.normal))

        carry = over_solids(solids, solids.casters, carry, visit)
    return carry


def _covers(solid, point: Vector, normal: Vector) -> jax.Array:
    """Share of the ambient light that a solid takes away: that of the ball nearest to the point inside its box, at
    height n.v over the surface: n.v/|v| r^2 / (|v|^2 + r^2), r^2 of the ball's mean projected area."""
    local, facing, half = into(solid, point, normal)
    ball = tuple(jnp.minimum(h, _NEARBY) for h in half)
    square = (ball[0] * ball[1] + ball[1] * ball[2] + ball[2] * ball[0]) * (2 / jnp.pi)
    v = tuple(jnp.clip(p, b - h, h - b) - p for p, b, h in zip(local, ball, half, strict=True))
    square_away = dot(v, v) + 1e-6
    return jnp.maximum(dot(v, facing), 0) * jax.lax.rsqrt(square_away) * square / (square_away + square)


def _ambient(room: Room, hits: SurfaceHits, open_sky: jax.Array) -> Vector:
    """What floor, ceiling and walls send back, less in their corners."""
    for axis in range(3):
        across = _CORNER_DEPTH * (1 - jnp.abs(hits.normal[axis]))
        for wall in (room.low[axis], room.high[axis]):
            near = jnp.clip(1 - jnp.abs(hits.point[axis] - wall) / _CORNER, 0, 1)
            open_sky = open_sky * (1 - across * near * near * near)
    up = 0.5 + 0.5 * hits.normal[2]
    below, above = components(room.ambient[0]), components(room.ambient[1])
    return tuple(open_sky * (b + (a - b) * up) for a, b in zip(above, below, strict=True))


def pixel_footprint(ray: Vector, step: Vector, distance: jax.Array, normal: Vector) -> Vector:
    """Metres that the hit moves when the ray moves by `step`: t (step - ray (n.step) / (n.ray))."""
    slant = dot(normal, step) / jnp.minimum(dot(normal, ray), -1e-3)
    return scale(subtract(step, scale(ray, slant)), distance)
