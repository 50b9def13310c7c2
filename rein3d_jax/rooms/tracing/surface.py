"""The surface at each hit: its normal, its place in its own axes, and what table row describes it."""

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.rooms.model import Room
from rein3d_jax.rooms.tracing.nearest import SHELL_FACES, cos_sin, families, nearest, point_at
from rein3d_jax.rooms.tracing.vectors import (
    Vector,
    choose,
    components,
    dot,
    rotate_left,
    rotate_right,
    scale,
    subtract,
    unit,
)


@struct.dataclass
class SurfaceHits:
    """Where rays met the room; every leaf has the pixels' shape."""

    index: jax.Array  # int surface index, as rein3d_jax.rooms.tracing.nearest gives it
    distance: jax.Array  # metres along the ray
    point: Vector  # metres, the room's axes
    normal: Vector  # unit, the room's axes, facing the ray
    local: Vector  # metres, the solid's own axes, from its centre (the room's, for the shell)
    half: Vector  # metres, the solid's half size
    face: jax.Array  # int 0, 1, 2: the own axis nearest to the normal
    heading: tuple[jax.Array, jax.Array]  # cosine and sine of the solid's yaw


@struct.dataclass
class SurfaceTable:
    """One row for each surface index."""

    centre: jax.Array  # (s, 3)
    half: jax.Array  # (s, 3)
    heading: jax.Array  # (s, 2)
    texture: jax.Array  # (s,) row of Room.textures
    object: jax.Array  # (s,)


def surface_table(room: Room) -> SurfaceTable:
    """Table of the shell's faces, openings and all solids."""
    openings = room.openings.half.shape[0]
    fixed = jnp.arange(SHELL_FACES + openings)
    shell = SurfaceTable(
        jnp.concatenate([jnp.zeros((SHELL_FACES, 3)), room.openings.centre]),
        jnp.concatenate([jnp.ones((SHELL_FACES, 3)), room.openings.half]),
        jnp.tile(jnp.array([1.0, 0.0]), (SHELL_FACES + openings, 1)),
        fixed,
        fixed,
    )
    solids = [SurfaceTable(s.centre, s.half, s.heading, s.texture, s.object) for s, _ in families(room)]
    return jax.tree.map(lambda *rows: jnp.concatenate(rows), shell, *solids)


def meet_surfaces(room: Room, table: SurfaceTable, origin: Vector, ray: Vector) -> SurfaceHits:
    """What each ray meets first, for origins inside the shell."""
    distance, index = nearest(room, origin, ray)
    point = point_at(origin, ray, distance)
    heading = tuple(x[index] for x in cos_sin(table.heading))
    half = tuple(x[index] for x in components(table.half))
    local = rotate_right(subtract(point, tuple(x[index] for x in components(table.centre))), heading)
    normal = _own_normal(room, local, half, index)
    nx, ny, nz = (jnp.abs(n) for n in normal)
    face = jnp.where((nx >= ny) & (nx >= nz), 0, jnp.where(ny >= nz, 1, 2))
    normal = rotate_left(normal, heading)
    facing = scale(normal, jnp.where(dot(normal, ray) > 0, -1.0, 1.0))
    return SurfaceHits(index, distance, point, facing, local, half, face, heading)


def _own_normal(room: Room, local: Vector, half: Vector, index: jax.Array) -> Vector:
    """Unit normal in the surface's own axes, of either sign."""
    _, (_, cylinders), (_, ellipsoids) = families(room)
    x, y, z = (a / h for a, h in zip(local, half, strict=True))
    ax, ay, az = jnp.abs(x), jnp.abs(y), jnp.abs(z)
    one, nothing = jnp.ones_like(x), jnp.zeros_like(x)
    by_x, by_z = (ax >= ay) & (ax >= az), (az > ax) & (az > ay)
    by_x = jnp.where(index < SHELL_FACES, (index == 2) | (index == 4), by_x)
    by_z = jnp.where(index < SHELL_FACES, index < 2, by_z)
    flat = choose(by_x, (one, nothing, nothing), choose(by_z, (nothing, nothing, one), (nothing, one, nothing)))
    side = (x / half[0], y / half[1], jnp.where(index < ellipsoids, 0.0, z / half[2]))
    curved = unit((side[0], side[1], side[2] + 1e-12))
    cap = (index < ellipsoids) & (z * z > x * x + y * y)
    curved = choose(cap, (nothing, nothing, one), curved)
    return choose(index >= cylinders, curved, flat)


def surface_coordinates(face: jax.Array, a: Vector) -> tuple[jax.Array, jax.Array]:
    """Two components of `a` along the surface: y, z on faces along x; x, z along y; x, y along z."""
    return jnp.where(face == 0, a[1], a[0]), jnp.where(face == 2, a[1], a[2])
