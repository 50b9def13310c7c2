"""The surface at each hit: its normal, its place in its own axes, and what table row describes it."""

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.rooms.model import Room
from rein3d_jax.rooms.tracing.nearest import FACES, families, split_turn
from rein3d_jax.rooms.tracing.vectors import Vector, choose, dot, scale, split, subtract, turn_left, turn_right, unit


@struct.dataclass
class Hits:
    """Where rays met the room; every leaf has the pixels' shape."""

    index: jax.Array  # int surface index, as rein3d_jax.rooms.tracing.nearest gives it
    point: Vector  # metres, the room's axes
    normal: Vector  # unit, the room's axes, facing the ray
    local: Vector  # metres, the solid's own axes, from its centre (the room's, for the shell)
    half: Vector  # metres, the solid's half size
    face: jax.Array  # int 0, 1, 2: the own axis that the surface looks along most
    turn: tuple[jax.Array, jax.Array]  # cosine and sine of the solid's yaw


@struct.dataclass
class Table:
    """One row for each surface index."""

    centre: jax.Array  # (s, 3)
    half: jax.Array  # (s, 3)
    turn: jax.Array  # (s, 2)
    texture: jax.Array  # (s,) row of Room.textures
    object: jax.Array  # (s,)


def surface_table(room: Room) -> Table:
    """The shell's faces, openings and all solids in one table."""
    openings = room.openings.half.shape[0]
    fixed = jnp.arange(FACES + openings)
    shell = Table(
        jnp.concatenate([jnp.zeros((FACES, 3)), room.openings.centre]),
        jnp.concatenate([jnp.ones((FACES, 3)), room.openings.half]),
        jnp.tile(jnp.array([1.0, 0.0]), (FACES + openings, 1)),
        fixed,
        fixed,
    )
    solids = [Table(s.centre, s.half, s.turn, s.texture, s.object) for s, _ in families(room)]
    return jax.tree.map(lambda *rows: jnp.concatenate(rows), shell, *solids)


def describe(room: Room, table: Table, point: Vector, ray: Vector, index: jax.Array) -> Hits:
    """The surface that was met at `point` by `ray`."""
    turn = tuple(x[index] for x in split_turn(table.turn))
    half = tuple(x[index] for x in split(table.half))
    local = turn_right(subtract(point, tuple(x[index] for x in split(table.centre))), turn)
    normal = _own_normal(room, local, half, index)
    nx, ny, nz = (jnp.abs(n) for n in normal)
    face = jnp.where((nx >= ny) & (nx >= nz), 0, jnp.where(ny >= nz, 1, 2))
    normal = turn_left(normal, turn)
    facing = scale(normal, jnp.where(dot(normal, ray) > 0, -1.0, 1.0))
    return Hits(index, point, facing, local, half, face, turn)


def _own_normal(room: Room, local: Vector, half: Vector, index: jax.Array) -> Vector:
    """Unit normal in the surface's own axes, of either sign."""
    _, (_, cylinders), (_, ellipsoids) = families(room)
    x, y, z = (a / h for a, h in zip(local, half, strict=True))
    ax, ay, az = jnp.abs(x), jnp.abs(y), jnp.abs(z)
    one, nothing = jnp.ones_like(x), jnp.zeros_like(x)
    by_x, by_z = (ax >= ay) & (ax >= az), (az > ax) & (az > ay)
    by_x = jnp.where(index < FACES, (index == 2) | (index == 4), by_x)
    by_z = jnp.where(index < FACES, index < 2, by_z)
    flat = choose(by_x, (one, nothing, nothing), choose(by_z, (nothing, nothing, one), (nothing, one, nothing)))
    side = (x / half[0], y / half[1], jnp.where(index < ellipsoids, 0.0, z / half[2]))
    curved = unit((side[0], side[1], side[2] + 1e-12))
    cap = (index < ellipsoids) & (z * z > x * x + y * y)
    curved = choose(cap, (nothing, nothing, one), curved)
    return choose(index >= cylinders, curved, flat)


def surface_coordinates(face: jax.Array, a: Vector) -> tuple[jax.Array, jax.Array]:
    """The two components of `a` along the surface: y, z on faces along x; x, z along y; x, y along z."""
    return jnp.where(face == 0, a[1], a[0]), jnp.where(face == 2, a[1], a[2])
