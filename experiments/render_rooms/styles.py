"""What each style of room is made of: sizes, damp, and how it is furnished."""

import numpy as np

from experiments.render_rooms import groups
from experiments.render_rooms.arrangement import Arrangement
from experiments.render_rooms.fittings import hang_picture
from experiments.render_rooms.polygon import polygon_area

# style: odds, smallest and largest side in metres, damp
STYLES = {
    "living": (0.26, 3.2, 8.5, "dry"),
    "bedroom": (0.18, 2.6, 6.0, "dry"),
    "kitchen": (0.14, 2.2, 6.0, "wet"),
    "bathroom": (0.09, 2.0, 4.0, "wet"),
    "office": (0.13, 2.4, 8.0, "dry"),
    "child": (0.06, 2.5, 5.0, "dry"),
    "hall": (0.04, 2.0, 7.0, "dry"),
    "store": (0.04, 2.0, 6.0, "dry"),
    "play": (0.03, 4.0, 9.0, "dry"),
    "empty": (0.03, 2.2, 9.0, "dry"),
}


def furnish(a: Arrangement, style: str) -> None:
    """Furnish the room in `style`, with more or less clutter."""
    clutter = float(a.rng.beta(1.7, 1.4))
    _FURNISHERS[style](a)
    crowd = float(np.clip(polygon_area(a.plan.corners) / 12, 0.8, 3.0))  # large rooms hold more
    for kind, most in (extra.split(":") for extra in _EXTRAS[style].split()):
        for _ in range(int(a.rng.binomial(round(crowd * int(most)), 0.3 + 0.65 * clutter))):
            a.against_wall(kind)
    for _ in range(int(a.rng.poisson(4 * crowd * clutter**2))):
        a.in_middle("bath_floor" if style == "bathroom" else "floor_thing", margin=0.1)
    if style != "empty":
        groups.pictures(a, int(crowd * a.rng.integers(0, 8)), 0.06)
    for piece in list(a.placed):
        if piece.base < 0.1 and 0.4 < piece.size[2] < 1.3 and piece.model.top and a.rng.random() < 0.3 * clutter:
            a.on_top(piece, "trinket", 0.5) if _takes_things(piece.model.credit[0]) else None


def _takes_things(name: str) -> bool:
    return any(
        word in name.lower() for word in ("dresser", "chest", "shelves", "box", "cabinet", "sideboard", "bookcase")
    )


def _living(a: Arrangement) -> None:
    groups.seat_group(a)
    if a.rng.random() < 0.5:
        groups.dining_group(a)
    if a.rng.random() < 0.15:
        groups.desk_group(a)
    if a.rng.random() < 0.12:
        a.against_wall("piano")
    if a.rng.random() < 0.2:
        groups.kitchen_row(a)
    _standing_lamp(a)


def _bedroom(a: Arrangement) -> None:
    groups.bed_group(a)
    a.against_wall("wardrobe")
    if a.rng.random() < 0.4:
        groups.desk_group(a)
    if a.rng.random() < 0.4:
        a.against_wall("armchair")
    _standing_lamp(a)


def _kitchen(a: Arrangement) -> None:
    groups.kitchen_row(a)
    if a.rng.random() < 0.5:
        groups.kitchen_row(a)
    if a.rng.random() < 0.3 and (island := a.in_middle("kitchen_island", margin=0.6)):
        groups.ring_of_chairs(a, island, a.choose("bar_stool").key, 3, "bar_stool")
    groups.dining_group(a)


def _bathroom(a: Arrangement) -> None:
    a.against_wall("bath" if a.rng.random() < 0.6 else "shower")
    a.against_wall("toilet")
    if (found := a.against_wall("washbasin")) and found[0].size[2] < 1.3:
        basin, edge, along = found
        size = (float(min(basin.size[0], a.rng.uniform(0.4, 1.0))), float(a.rng.uniform(0.5, 0.8)))
        if a.rng.random() < 0.6:
            a.faces += hang_picture(a.plan, edge, (along, 1.55), size, "mirror")
    for kind in ("bidet", "washer"):
        if a.rng.random() < 0.35:
            a.against_wall(kind)


def _office(a: Arrangement) -> None:
    big = np.ptp(a.plan.corners, axis=0).min() > 4
    for _ in range(int(a.rng.integers(1, 6 if big else 3))):
        groups.desk_group(a)
    if a.rng.random() < 0.3 and (table := a.in_middle("dining_table")):
        groups.ring_of_chairs(a, table, a.choose("office_chair").key, 6, "office_chair")
    if a.rng.random() < 0.3:
        a.in_middle("board", margin=0.3)


def _child(a: Arrangement) -> None:
    a.against_wall("single_bed" if a.rng.random() < 0.7 else "crib")
    groups.desk_group(a)
    a.against_wall("wardrobe")
    for _ in range(int(a.rng.integers(2, 6))):
        a.in_middle("toy", margin=0.1)
    groups.rug_under(a, a.plan.corners.mean(0), (float(a.rng.uniform(1.2, 2.2)), 1.5), 0.0)


def _hall(a: Arrangement) -> None:
    groups.rug_under(a, a.plan.corners.mean(0), (float(a.rng.uniform(0.8, 1.5)), float(a.rng.uniform(1.5, 2.5))), 0.0)
    a.against_wall("bench")


def _store(a: Arrangement) -> None:
    for _ in range(int(a.rng.integers(4, 14))):
        a.against_wall("store")
    for _ in range(int(a.rng.integers(0, 5))):
        a.in_middle("store", margin=0.05)


def _play(a: Arrangement) -> None:
    a.in_middle("game", margin=0.6)
    for _ in range(int(a.rng.integers(1, 4))):
        a.in_middle("sport", margin=0.3)
    if a.rng.random() < 0.6:
        groups.seat_group(a)


def _empty(a: Arrangement) -> None:
    for _ in range(int(a.rng.integers(0, 3))):
        a.in_middle("floor_thing", margin=0.1)


def _standing_lamp(a: Arrangement) -> None:
    if a.rng.random() < 0.35 and (found := a.against_wall("floor_lamp")):
        groups.lamp_light(a, found[0], found[0].size[2] + 0.05, a.rng.uniform(10, 50))


_FURNISHERS = {
    "living": _living, "bedroom": _bedroom, "kitchen": _kitchen, "bathroom": _bathroom, "office": _office,
    "child": _child, "hall": _hall, "store": _store, "play": _play, "empty": _empty,
}  # fmt: skip

# What stands or hangs about besides: kind:most.
_EXTRAS = {
    "living": "bookcase:3 sideboard:2 plant:3 armchair:1 radiator:1 wall_lamp:1 wall_thing:1 pet:1 screen:1",
    "bedroom": "dresser:2 plant:1 bookcase:1 chair:1 radiator:1 wall_lamp:1 clothes:1",
    "kitchen": "washer:1 bin:1 sideboard:1 plant:1 chair:1 radiator:1 kitchen_tall:1",
    "bathroom": "bath_wall:3 bath_floor:2 plant:1",
    "office": "office_cupboard:3 bookcase:3 plant:2 bin:1 radiator:1 sofa:1 wall_thing:1",
    "child": "bookcase:2 toy:3 dresser:1 plant:1 radiator:1",
    "hall": "sideboard:2 plant:3 bookcase:1 radiator:1 wall_lamp:2 chair:2",
    "store": "bookcase:2 washer:2 store:4",
    "play": "bookcase:1 plant:2 sport:2 bench:2 sofa:1",
    "empty": "radiator:2",
}
