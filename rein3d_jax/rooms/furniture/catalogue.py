"""The furniture there is, by name, and the tables that a room is furnished from."""

import numpy as np

from rein3d_jax.rooms.config import ROOM_KINDS
from rein3d_jax.rooms.furniture.hung import HUNG_PIECES
from rein3d_jax.rooms.furniture.seats import SEAT_PIECES
from rein3d_jax.rooms.furniture.storage import STORAGE_PIECES
from rein3d_jax.rooms.furniture.template import MAX_PARTS, MAX_TEXTURES
from rein3d_jax.rooms.furniture.wet import WET_PIECES
from rein3d_jax.rooms.materials import GROUP_INDEX

PIECES = SEAT_PIECES | STORAGE_PIECES | WET_PIECES | HUNG_PIECES
PIECE_NAMES = tuple(PIECES)
NO_PIECE = len(PIECE_NAMES)  # the index that stands for no piece

_PICTURES = ({"picture": 3, "wall_shelf": 1, "mirror": 0.5}, {"picture": 3, "wall_shelf": 1, "none": 1.5})
_LAMP = {"pendant": 3, "ceiling_disc": 3, "spots": 1.5}
_GREEN = {"plant": 3, "tall_plant": 1.5, "none": 1.5}
# What each kind of room holds: one piece for each row, drawn by weight, placed in this order: large things first.
_PROGRAMS = {
    "living_dining": (
        _LAMP, {"dining": 4, "round_dining": 2}, {"sofa": 4, "corner_sofa": 2}, {"tv_unit": 4, "cabinet": 1},
        {"shelf": 3, "cabinet": 2, "wardrobe": 1, "open_shelf": 2}, {"coffee_table": 4, "round_table": 2, "pouf": 1},
        {"armchair": 3, "chair": 1, "none": 1}, {"cabinet": 2, "side_table": 2, "desk": 1, "none": 1}, _GREEN,
        {"floor_lamp": 3, "none": 1}, {"rug": 3, "none": 2}, *_PICTURES, {"curtain": 1, "radiator": 1, "none": 2},
    ),
    "living": (
        _LAMP, {"sofa": 3, "corner_sofa": 2}, {"tv_unit": 4, "cabinet": 1}, {"sofa": 2, "armchair": 2, "none": 1},
        {"shelf": 3, "open_shelf": 2, "cabinet": 2}, {"coffee_table": 4, "round_table": 2, "pouf": 1},
        {"armchair": 3, "chair": 1, "none": 1}, {"desk": 1.5, "side_table": 2, "wardrobe": 1, "none": 1}, _GREEN,
        {"floor_lamp": 4, "none": 1}, {"rug": 3, "none": 1}, *_PICTURES, {"tall_plant": 1, "radiator": 1, "none": 1},
    ),
    "bedroom": (
        _LAMP, {"bed": 5, "single_bed": 2}, {"wardrobe": 5, "cabinet": 1}, {"desk": 2, "cabinet": 3, "none": 0.5},
        {"nightstand": 3, "side_table": 1}, {"nightstand": 2, "none": 1}, {"shelf": 2, "open_shelf": 1.5, "none": 1},
        {"armchair": 1.5, "chair": 2, "pouf": 1, "none": 1}, _GREEN, {"floor_lamp": 2, "none": 2},
        {"rug": 3, "none": 2}, *_PICTURES, {"radiator": 1, "none": 2},
    ),
    "kitchen": (
        _LAMP, {"counter": 1}, {"fridge": 4, "none": 1}, {"counter": 2, "short_counter": 3}, {"wall_cabinets": 1},
        {"dining": 2, "round_dining": 2, "island": 2, "none": 0.5}, {"cabinet": 2, "open_shelf": 2, "none": 1},
        {"chair": 1, "none": 1}, {"wall_cabinets": 1, "wall_shelf": 1, "none": 1}, _GREEN, {"none": 1}, *_PICTURES,
        {"radiator": 1, "none": 2},
    ),
    "bathroom": (
        _LAMP, {"bathtub": 3, "shower": 2}, {"vanity": 1}, {"toilet": 6, "none": 1}, {"mirror": 4, "none": 1},
        {"cabinet": 2, "open_shelf": 1, "none": 1}, {"washer": 2, "none": 2}, {"pouf": 0.5, "none": 1},
        {"plant": 1, "none": 2}, {"none": 1}, {"rug": 1, "none": 2}, {"picture": 1, "none": 2},
        {"radiator": 2, "none": 1}, {"wall_shelf": 1, "none": 1},
    ),
}  # fmt: skip
SLOTS = 14
PLACES = ("wall", "free", "hung", "flat", "ceiling")


def program_weights() -> np.ndarray:
    """Weights (kinds, SLOTS, pieces + 1); the last column is no piece."""
    table = np.zeros((len(ROOM_KINDS), SLOTS, NO_PIECE + 1), np.float32)
    for kind, name in enumerate(ROOM_KINDS):
        for slot, weights in enumerate(_PROGRAMS[name]):
            for piece, weight in weights.items():
                table[kind, slot, NO_PIECE if piece == "none" else PIECE_NAMES.index(piece)] = weight
    return table


def size_ranges() -> np.ndarray:
    """Ranges (pieces + 1, 4, 2) of width, depth, height, lift in metres; no piece has no size."""
    rows = [(p.width, p.depth, p.height, p.lift) for p in PIECES.values()]
    return np.array([*rows, np.zeros((4, 2))], np.float32)


def places() -> np.ndarray:
    """Places (pieces + 1,) as indices into PLACES."""
    return np.array([*(PLACES.index(p.place) for p in PIECES.values()), 0])


def texture_groups() -> np.ndarray:
    """Textures (pieces + 1, MAX_TEXTURES) as indices into materials.GROUPS; the last one fills up."""
    rows = [[GROUP_INDEX[name] for name in p.textures] for p in PIECES.values()]
    assert max(map(len, rows)) <= MAX_TEXTURES
    return np.array([*(row + row[-1:] * (MAX_TEXTURES - len(row)) for row in rows), [0] * MAX_TEXTURES])


def part_tables() -> dict[str, np.ndarray]:
    """Tables (pieces + 1, MAX_PARTS): bounds (.., 3, 2, 4) in W, D, H, M; shape, texture, casts; chance, 0: no part."""
    count = (NO_PIECE + 1, MAX_PARTS)
    bounds, shape, texture = np.zeros((*count, 3, 2, 4), np.float32), np.zeros(count, int), np.zeros(count, int)
    chance, casts = np.zeros(count, np.float32), np.zeros(count, bool)
    for i, (name, piece) in enumerate(PIECES.items()):
        assert len(piece.parts) <= MAX_PARTS, f"{name} has {len(piece.parts)} parts, {MAX_PARTS} are the limit"
        for j, part in enumerate(piece.parts):
            bounds[i, j] = part.x, part.y, part.z
            shape[i, j], texture[i, j], chance[i, j] = part.shape, part.texture, part.chance
            casts[i, j] = part.casts
    return {"bounds": bounds, "shape": shape, "texture": texture, "casts": casts, "chance": chance}
