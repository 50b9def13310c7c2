"""A furnished room from a key: the same key, the same room."""

import jax
import jax.numpy as jnp

from rein3d_jax.rooms.config import ROOM_KINDS, RoomConfig
from rein3d_jax.rooms.furniture.catalogue import NO_PIECE, SLOTS, texture_groups
from rein3d_jax.rooms.furniture.footprints import NOWHERE, join_footprints
from rein3d_jax.rooms.furniture.furnish import Furniture, Parts, parts_of, place_furniture
from rein3d_jax.rooms.furniture.template import BOX, CYLINDER, ELLIPSOID, MAX_TEXTURES
from rein3d_jax.rooms.lighting import draw_exposure, draw_lights, draw_outside, reflected
from rein3d_jax.rooms.materials import GROUP_INDEX, draw_textures
from rein3d_jax.rooms.model import Room, Solids, Textures
from rein3d_jax.rooms.openings import OPENINGS, draw_openings
from rein3d_jax.rooms.plan import STRUCTURE, Plan, draw_plan, draw_walkway, structure_footprints

_SHELL = 6  # textures and object ids of floor, ceiling and walls
_FIRST_STRUCTURE = _SHELL + OPENINGS
_FIRST_PIECE = _FIRST_STRUCTURE + 1


def generate_room(key: jax.Array, config: RoomConfig = RoomConfig()) -> Room:
    """A room around a camera at the origin, 1.6 m above the floor and config.clearance metres from all that stands.

    Pure; works under jit (config static) and vmap over keys. Nothing stands in walls or in other things. What found no
    place is left out; what found no slot in the buffers is counted in Room.overflow.
    """
    keys = iter(jax.random.split(key, 14))
    kind = jax.random.categorical(next(keys), jnp.log(jnp.array(config.mix)))
    plan = draw_plan(next(keys), kind)
    windowless = jnp.where(kind == ROOM_KINDS.index("bathroom"), 0.5, 0.2)
    openings, before = draw_openings(next(keys), plan, windowless)
    taken = join_footprints(structure_footprints(plan), before, draw_walkway(next(keys), plan))
    furniture = place_furniture(next(keys), plan, kind, taken, config.clearance, config.furnished)
    textures = _textures(next(keys), kind, furniture)
    lights = draw_lights(next(keys), plan, furniture, openings)
    boost = jax.random.uniform(next(keys), minval=0.8, maxval=1.7)
    ambient, radiosity = reflected(plan, lights, textures, boost)
    families, overflow = _solids(plan, furniture, parts_of(next(keys), furniture, plan.low[2]), config)
    return Room(
        low=plan.low,
        high=plan.high,
        yaw=jax.random.uniform(next(keys), minval=-jnp.pi, maxval=jnp.pi),
        kind=kind,
        seed=jax.random.bits(next(keys)),
        **families,
        openings=openings,
        textures=textures,
        lights=lights,
        outside=draw_outside(next(keys)),
        ambient=ambient,
        exposure=draw_exposure(next(keys), radiosity),
        gamma=jax.random.uniform(next(keys), minval=0.85, maxval=1.15),
        # Of a key of its own: with any share, a key gives the same room.
        open_windows=jax.random.bernoulli(jax.random.fold_in(key, 0), config.open_windows),
        overflow=overflow,
    )


def _textures(key: jax.Array, kind: jax.Array, furniture: Furniture) -> Textures:
    """Shell, openings, structure, then MAX_TEXTURES for each piece. Walls are often alike, one may stand out."""
    draw_key, alike_key, accent_key, which_key = jax.random.split(key, 4)
    wet = (kind == ROOM_KINDS.index("bathroom")) | (kind == ROOM_KINDS.index("kitchen"))
    tiled = kind == ROOM_KINDS.index("bathroom")
    wall = jnp.where(tiled, GROUP_INDEX["wet_wall"], GROUP_INDEX["wall"])
    floor = jnp.where(wet, GROUP_INDEX["wet_floor"], GROUP_INDEX["floor"])
    accent = jax.random.bernoulli(accent_key, 0.55) & (jnp.arange(4) == jax.random.randint(which_key, (), 0, 4))
    walls = jnp.where(accent, GROUP_INDEX["accent"], wall)
    fixed = [floor, GROUP_INDEX["ceiling"], *walls, *[GROUP_INDEX["leaf_of_door"]] * OPENINGS, wall]
    of_pieces = jnp.asarray(texture_groups())[furniture.piece].reshape(-1)
    groups = jnp.concatenate([jnp.stack([jnp.asarray(x) for x in fixed]), of_pieces])
    textures = draw_textures(draw_key, groups)
    plain = jnp.argsort(accent)  # walls that do not stand out come first
    copied = jnp.where(jax.random.bernoulli(alike_key, 0.75, (4,)), plain[0], plain[1])
    source = jnp.where(accent, jnp.arange(4), copied) + 2
    source = jnp.arange(len(groups)).at[2:6].set(source).at[_FIRST_STRUCTURE].set(source[0])
    return jax.tree.map(lambda x: x[source], textures)


def _solids(plan: Plan, furniture: Furniture, parts: Parts, config: RoomConfig) -> tuple[dict[str, Solids], jax.Array]:
    """Structure and parts, packed by shape; and how many found no slot."""
    low, high = plan.structure_low, plan.structure_high
    zero = jnp.int32(0)
    piece = jnp.broadcast_to(jnp.arange(SLOTS)[:, None], parts.there.shape)
    textures = _FIRST_PIECE + piece * MAX_TEXTURES + parts.texture
    furnishing = Solids(parts.centre, parts.half, parts.heading, textures, _FIRST_PIECE + piece, zero, zero)
    furnishing = jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]) if x.ndim else x, furnishing)
    unturned, first = jnp.tile(jnp.array([1.0, 0.0]), (STRUCTURE, 1)), jnp.full(STRUCTURE, _FIRST_STRUCTURE)
    structure = Solids((low + high) / 2, (high - low) / 2, unturned, first, first, zero, zero)
    every = jax.tree.map(lambda a, b: jnp.concatenate([a, b]) if a.ndim else a, structure, furnishing)
    there = parts.there & (furniture.piece != NO_PIECE)[:, None]
    there, shape, casts = (
        jnp.concatenate([a, b.reshape(-1)])
        for a, b in (
            (low[:, 0] > NOWHERE / 2, there),
            (jnp.full(STRUCTURE, BOX), parts.shape),
            (jnp.full(STRUCTURE, True), parts.casts),
        )
    )
    capacities = {"boxes": (BOX, config.boxes), "cylinders": (CYLINDER, config.cylinders)}
    capacities["ellipsoids"] = (ELLIPSOID, config.ellipsoids)
    packed = {name: pack(every, there & (shape == one), casts, size) for name, (one, size) in capacities.items()}
    return {name: solids for name, (solids, _) in packed.items()}, sum(lost for _, lost in packed.values())


def pack(solids: Solids, chosen: jax.Array, casts: jax.Array, capacity: int) -> tuple[Solids, jax.Array]:
    """The chosen rows, those that cast shadows first; empty slots lie far away; and how many rows found no slot."""
    count = jnp.minimum(chosen.sum(), capacity)
    order = jnp.argsort(jnp.where(chosen, jnp.where(casts, 0, 1), 2), stable=True)[:capacity]
    used = jnp.arange(capacity) < count
    rows = jax.tree.map(lambda x: x[order] if x.ndim else x, solids)
    centre = jnp.where(used[:, None], rows.centre, NOWHERE)
    half = jnp.where(used[:, None], rows.half, 0.01)
    casters = jnp.minimum((chosen & casts).sum(), count)
    return rows.replace(centre=centre, half=half, count=count, casters=casters), chosen.sum() - count
