"""Furniture into a plan: pieces drawn by a room kind's program, each set down where it fits."""

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.rooms.furniture import catalogue
from rein3d_jax.rooms.furniture.catalogue import NO_PIECE, SLOTS
from rein3d_jax.rooms.furniture.footprints import (
    NOWHERE,
    Footprint,
    corners,
    distance_from_origin,
    footprints_overlap,
    join_footprints,
)
from rein3d_jax.rooms.plan import Plan

_TRIES = 128
_GAP = 0.015  # metres between a piece and the walls
_BODY = (0.03, 1.9)  # metres above the floor: what the camera's clearance counts


@struct.dataclass
class Furniture:
    """SLOTS pieces; one that is not there stands NOWHERE."""

    piece: jax.Array  # (SLOTS,) index into catalogue.PIECE_NAMES, NO_PIECE where nothing stands
    place: Footprint  # (SLOTS,)
    size: jax.Array  # (SLOTS, 3) width, depth, height in metres


def place_furniture(
    key: jax.Array, plan: Plan, kind: jax.Array, taken: Footprint, clearance: float, furnished: float
) -> Furniture:
    """Pieces for a room of `kind`, clear of `taken`, of one another, of the walls and of the origin."""
    kinds_key, sizes_key, spots_key, there_key = jax.random.split(key, 4)
    piece = jax.random.categorical(kinds_key, jnp.log(catalogue.program_weights())[kind], axis=-1)
    piece = jnp.where(jax.random.bernoulli(there_key, furnished, piece.shape), piece, NO_PIECE)
    low, high = jnp.moveaxis(jnp.asarray(catalogue.size_ranges())[piece], -1, 0)
    sizes = low + (high - low) * jax.random.uniform(sizes_key, low.shape)
    room_taken = sizes.at[:, 2].set(_tops(piece, sizes))
    absent = jax.tree.map(lambda x: jnp.full((SLOTS, *x.shape[1:]), NOWHERE), taken)

    def settle(placed, slot):
        index, slot_key = slot
        place = jnp.asarray(catalogue.places())[piece[index]]
        spot, fits = _find_spot(slot_key, plan, place, room_taken[index], placed, clearance)
        there = fits & (piece[index] != NO_PIECE)
        spot = spot.replace(centre=jnp.where(there, spot.centre, NOWHERE))
        return jax.tree.map(lambda x, row: x.at[index].set(row), placed, spot), there

    # New pieces come first in the list, at their slot's index; what was taken before follows.
    slots = jnp.arange(SLOTS), jax.random.split(spots_key, SLOTS)
    placed, there = jax.lax.scan(settle, join_footprints(absent, taken), slots)
    standing = jax.tree.map(lambda x: x[:SLOTS], placed)
    return Furniture(jnp.where(there, piece, NO_PIECE), standing, sizes[:, :3])


def _tops(piece: jax.Array, sizes: jax.Array) -> jax.Array:
    """(SLOTS,) metres to the top of the highest part there may be: a television stands on its cabinet."""
    tables = catalogue.part_tables()
    high = jnp.asarray(tables["bounds"][:, :, 2, 1])[piece]
    tops = jnp.einsum("spt,st->sp", high, _terms(sizes[:, :3]), precision="highest")
    return jnp.max(jnp.where(jnp.asarray(tables["chance"])[piece] > 0, tops, 0.0), axis=-1)


def _terms(size: jax.Array) -> jax.Array:
    """(SLOTS, 4): what a table's columns W, D, H, M stand for."""
    return jnp.append(size, jnp.ones((SLOTS, 1)), axis=-1)


def _find_spot(key, plan: Plan, place, size, placed: Footprint, clearance: float) -> tuple[Footprint, jax.Array]:
    """The first of _TRIES spots that fits, and whether any does."""
    spots = jax.vmap(lambda k: _candidate(k, plan, place, size))(jax.random.split(key, _TRIES))
    free = ~jnp.any(jax.vmap(lambda one: footprints_overlap(one, placed))(spots), axis=-1)
    at = corners(spots)
    within = jnp.all((at > plan.low[:2] + _GAP / 2) & (at < plan.high[:2] - _GAP / 2), axis=(-1, -2))
    tall = plan.high[2] - plan.low[2]
    low_enough = spots.heights[:, 1] <= tall
    in_the_way = (spots.heights[:, 0] < _BODY[1]) & (spots.heights[:, 1] > _BODY[0])
    clear = (distance_from_origin(spots) >= clearance) | ~in_the_way
    fits = free & within & low_enough & clear
    return jax.tree.map(lambda x: x[jnp.argmax(fits)], spots), jnp.any(fits)


def _candidate(key: jax.Array, plan: Plan, place: jax.Array, size: jax.Array) -> Footprint:
    """A piece somewhere that its kind of place allows; size is width, depth, height, lift."""
    wall_key, along_key, yaw_key, square_key = jax.random.split(key, 4)
    width, depth, height, lift = size
    is_at = {name: place == index for index, name in enumerate(catalogue.PLACES)}
    at_wall = is_at["wall"] | is_at["hung"]
    wall = jax.random.randint(wall_key, (), 0, 4)
    # Its back, +y, is at the wall; in the open, three of five stand square to the walls.
    any_yaw = jax.random.uniform(yaw_key, minval=-jnp.pi, maxval=jnp.pi)
    square = jax.random.bernoulli(square_key, 0.6)
    angle = jnp.where(at_wall | square, (wall - 1) * (jnp.pi / 2), any_yaw)
    half = jnp.stack([width, depth]) / 2
    heading = jnp.stack([jnp.cos(angle), jnp.sin(angle)])
    across = jnp.abs(jnp.stack([heading[0] * half[0], heading[1] * half[0]]))
    extent = across + jnp.abs(jnp.stack([heading[1] * half[1], heading[0] * half[1]])) + _GAP
    low, high = plan.low[:2] + extent, plan.high[:2] - extent
    centre = low + (high - low) * jax.random.uniform(along_key, (2,))
    axis = wall % 2
    back = jnp.where(wall < 2, high[axis], low[axis])
    centre = jnp.where(at_wall & (jnp.arange(2) == axis), back, centre)
    tall = plan.high[2] - plan.low[2]
    bottom = jnp.where(is_at["ceiling"], tall - height, jnp.where(is_at["hung"], lift, 0.0))
    # What lies flat is in nobody's way.
    heights = jnp.where(is_at["flat"], jnp.array([-1.0, -0.9]), jnp.stack([bottom, bottom + height]))
    return Footprint(centre, half, heading, heights)


@struct.dataclass
class Parts:
    """Every part of every piece: unit shapes in the room's axes."""

    centre: jax.Array  # (SLOTS, MAX_PARTS, 3) metres
    half: jax.Array  # (SLOTS, MAX_PARTS, 3) metres
    heading: jax.Array  # (SLOTS, MAX_PARTS, 2)
    shape: jax.Array  # (SLOTS, MAX_PARTS) template.BOX, CYLINDER or ELLIPSOID
    texture: jax.Array  # (SLOTS, MAX_PARTS) which of the piece's textures
    casts: jax.Array  # (SLOTS, MAX_PARTS) bool
    there: jax.Array  # (SLOTS, MAX_PARTS) bool


def parts_of(key: jax.Array, furniture: Furniture, floor: jax.Array) -> Parts:
    """The parts of all pieces, at their places."""
    tables = {name: jnp.asarray(table)[furniture.piece] for name, table in catalogue.part_tables().items()}
    bounds = jnp.einsum("spabt,st->spab", tables["bounds"], _terms(furniture.size), precision="highest")
    low, high = jnp.moveaxis(bounds, -1, 0)
    centre, half = (low + high) / 2, (high - low) / 2
    place = furniture.place
    c, s = (place.heading[:, i, None] for i in range(2))
    x, y = c * centre[..., 0] - s * centre[..., 1], s * centre[..., 0] + c * centre[..., 1]
    bottom = jnp.maximum(place.heights[:, :1], 0) + floor
    centre = jnp.stack([x + place.centre[:, :1], y + place.centre[:, 1:], centre[..., 2] + bottom], axis=-1)
    there = jax.random.uniform(key, tables["chance"].shape) < tables["chance"]
    there &= jnp.all(half > 0.001, axis=-1)  # what a small piece has no room for
    heading = jnp.broadcast_to(place.heading[:, None], (*there.shape, 2))
    return Parts(centre, half, heading, tables["shape"], tables["texture"], tables["casts"], there)
