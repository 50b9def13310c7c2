"""Pieces that belong together: a sofa and its table, a bed and its lamps, a table and chairs, a row of cupboards."""

import numpy as np

from experiments.render_rooms.arrangement import Arrangement, PlacedModel
from experiments.render_rooms.fittings import hang_picture, lay_rug
from experiments.render_rooms.polygon import edge_frame, rectangle

_LAMP_COLOURS = ((1.0, 0.62, 0.32), (1.0, 0.75, 0.5), (1.0, 0.88, 0.75), (0.95, 0.97, 1.0))


def lamp_light(a: Arrangement, piece: PlacedModel, height: float, power: float) -> None:
    """Light for a lamp, `height` metres above its foot."""
    colour = _LAMP_COLOURS[a.rng.integers(len(_LAMP_COLOURS))]
    place = [*map(float, piece.centre), float(piece.base + height)]
    a.lights.append({"kind": "point", "place": place, "power": float(power), "colour": list(colour), "radius": 0.06})


def rug_under(a: Arrangement, centre: np.ndarray, size: tuple[float, float], yaw: float) -> None:
    """A rug of the room's own cloth, where the floor is free of walls."""
    area = rectangle(centre, size, yaw)
    if a.is_free(area, 0.0, 0.003, tuple(a.placed)):
        a.faces += lay_rug(centre, size, yaw)


def seat_group(a: Arrangement) -> None:
    """A sofa with a low table, a rug, armchairs and what it looks at."""
    kind = "corner_sofa" if a.rng.random() < 0.25 else "sofa"
    found = a.against_wall(kind) if a.rng.random() < 0.75 else None
    sofa = found[0] if found else a.in_middle(kind, margin=0.5)
    if sofa is None:
        return
    front = np.array([np.sin(sofa.yaw), -np.cos(sofa.yaw)])
    table = a.choose("coffee_table")
    away = -(sofa.size[1] / 2 + table.size[1] / 2 + a.rng.uniform(0.3, 0.5))
    low = a.beside(sofa, table, (float(a.rng.normal(0, 0.1)), away), 0.0) if a.rng.random() < 0.85 else None
    if a.rng.random() < 0.55:
        rug_under(
            a, sofa.to_room((0, away)), (float(a.rng.uniform(1.6, 2.8)), float(a.rng.uniform(1.2, 2.0))), sofa.yaw
        )
    for side in (-1, 1):
        chair = a.choose("armchair")
        if a.rng.random() < 0.45:
            reach = side * (sofa.size[0] / 2 + chair.size[1] / 2 - 0.1)
            a.beside(sofa, chair, (reach, away), side * -np.pi / 2 + float(a.rng.normal(0, 0.2)))
    for _ in range(int(a.rng.integers(0, 4)) if low else 0):
        a.on_top(low, str(a.rng.choice(["trinket", "vase", "small_plant", "tableware"])))
    television(a, front)


def television(a: Arrangement, front: np.ndarray | None) -> None:
    """A low cupboard with a television, or a wall unit, opposite to `front`."""
    if a.rng.random() < 0.3 and a.against_wall("wall_unit", facing=front):
        return
    found = a.against_wall("tv_stand", facing=front)
    if found is None:
        return
    stand, edge, along = found
    model = a.choose("tv", (stand.size[0], 9, 9))
    if model is not None and a.rng.random() < 0.8:
        a.put_on_wall(model, edge, along, max(stand.base + (stand.model.top or stand.size[2]), 0.3))
    else:
        a.on_top(stand, "trinket")


def dining_group(a: Arrangement) -> None:
    """A table with chairs, things on it, a lamp over it."""
    kind = "round_table" if a.rng.random() < 0.25 else "dining_table"
    table = a.in_middle(kind, margin=0.55)
    if table is None and (found := a.against_wall(kind)):
        table = found[0]
    if table is None:
        return
    chair = a.choose("chair")
    ring_of_chairs(a, table, chair.key, int(a.rng.integers(2, 9)))
    for _ in range(int(a.rng.integers(0, 5))):
        a.on_top(table, str(a.rng.choice(["tableware", "tableware", "vase", "small_plant", "trinket"])), 0.45)
    if a.rng.random() < 0.6:
        hanging_lamp(a, table.centre)


def ring_of_chairs(a: Arrangement, table: PlacedModel, key: str, count: int, kind: str = "chair") -> None:
    """Chairs of one model around `table`, looking at it."""
    model = next(m for m in a.catalog.models[kind] if m.key == key)
    w, d, _ = table.size
    seats = max(1, int((w - 0.1) / (model.size[0] + 0.12)))
    places = []
    for i in range(seats):
        x = (i + 0.5) / seats * w - w / 2
        places += [((x, d / 2), 0.0), ((x, -d / 2), np.pi)]
    places += [((w / 2, 0), -np.pi / 2), ((-w / 2, 0), np.pi / 2)]
    for i in a.rng.permutation(len(places))[:count]:
        (x, y), turn = places[i]
        out = model.size[1] / 2 + a.rng.uniform(-0.18, 0.12)
        away = (x, y + np.sign(y) * out) if abs(turn) in (0.0, np.pi) else (x + np.sign(x) * out, y)
        a.beside(table, model, away, turn + float(a.rng.normal(0, 0.12)))


def bed_group(a: Arrangement) -> None:
    """A bed with its head at a wall, bedside tables with lamps, a rug."""
    found = a.against_wall("bed" if a.rng.random() < 0.7 else "single_bed")
    if found is None:
        return
    bed, edge, along = found
    for side in (-1, 1):
        model = a.choose("bedside")
        if a.rng.random() < 0.75:
            reach = along + side * (bed.size[0] / 2 + model.size[0] / 2 + float(a.rng.uniform(0.02, 0.12)))
            table = a.put_on_wall(model, edge, reach)
            if table and a.rng.random() < 0.8:
                lit_lamp(a, table, "table_lamp")
    if a.rng.random() < 0.5:
        size = (bed.size[0] + float(a.rng.uniform(0.4, 1.2)), float(a.rng.uniform(1.2, 2.0)))
        rug_under(a, bed.to_room((0, -0.4 * bed.size[1])), size, bed.yaw)
    if a.rng.random() < 0.35:
        a.beside(bed, a.choose("bench", (bed.size[0], 9, 9)), (0, -bed.size[1] / 2 - 0.32), 0.0)


def desk_group(a: Arrangement) -> None:
    """A desk with its chair, computer, lamp and clutter; at a wall, or free in the room."""
    found = a.against_wall("desk") if a.rng.random() < 0.75 else None
    desk = found[0] if found else a.in_middle("desk", margin=0.6)
    if desk is None:
        return
    chair = a.choose("office_chair" if a.rng.random() < 0.75 else "chair")
    away = -(desk.size[1] / 2 + chair.size[1] / 2 - float(a.rng.uniform(-0.25, 0.15)))
    a.beside(desk, chair, (float(a.rng.normal(0, 0.15)), away), np.pi + float(a.rng.normal(0, 0.35)))
    a.on_top(desk, "computer")
    if a.rng.random() < 0.6:
        lit_lamp(a, desk, "desk_lamp")
    for _ in range(int(a.rng.integers(0, 5))):
        a.on_top(desk, "desk_thing", 0.4)


def kitchen_row(a: Arrangement) -> None:
    """Cupboards side by side along a wall, sink and stove among them, others above, things on top."""
    for _ in range(6):
        edge = a.some_edge()
        length = edge_frame(a.plan.corners, edge)[3]
        if length > 1.9:
            break
    names = ["kitchen_low"] * int(a.rng.integers(2, 6))
    names.insert(int(a.rng.integers(len(names))), "kitchen_sink")
    names.insert(int(a.rng.integers(len(names))), "kitchen_stove")
    if a.rng.random() < 0.75:
        names.insert(0 if a.rng.random() < 0.5 else len(names), "kitchen_tall")
    family = "Z" if a.rng.random() < 0.5 else "B"
    at = 0.04 if a.rng.random() < 0.6 else float(a.rng.uniform(0.04, max(0.05, length - 3.0)))
    for name in names:
        model = _of_family(a, name, family)
        if at + model.size[0] > length - 0.03:
            break
        base = a.put_on_wall(model, edge, at + model.size[0] / 2)
        if base is not None and name != "kitchen_tall":
            _above_cupboard(a, base, name, family, (edge, at + model.size[0] / 2))
        at += model.size[0] + (0.0 if base is not None else 0.3)


def _of_family(a: Arrangement, kind: str, family: str):
    ours = [model for model in a.catalog.models[kind] if model.key.startswith(family)] or a.catalog.models[kind]
    return ours[a.rng.integers(len(ours))]


def _above_cupboard(a: Arrangement, low: PlacedModel, name: str, family: str, spot: tuple[int, float]) -> None:
    if name == "kitchen_stove":
        a.put_on_wall(_of_family(a, "kitchen_hood", family), *spot)
    elif a.rng.random() < 0.7:
        up = _of_family(a, "kitchen_up", family)
        if up.size[0] <= low.size[0] + 0.12:
            a.put_on_wall(up, *spot)
    if name == "kitchen_low" and a.rng.random() < 0.6:
        a.on_top(low, "kitchen_thing", 0.9)


def lit_lamp(a: Arrangement, piece: PlacedModel, kind: str) -> None:
    """A lamp on `piece`, mostly switched on."""
    lamp = a.on_top(piece, kind, 0.95)
    if lamp is not None and a.rng.random() < 0.7:
        lamp_light(a, lamp, lamp.size[2] + 0.04, a.rng.uniform(3, 18))


def hanging_lamp(a: Arrangement, centre: np.ndarray) -> None:
    """A pendant over `centre`, switched on more often than not."""
    lamp = a.hang("pendant", centre)
    if lamp is not None and a.rng.random() < 0.75:
        lamp_light(a, lamp, -0.06, a.rng.uniform(30, 150))


def pictures(a: Arrangement, count: int, mirrors: float) -> None:
    """Frames on the walls; a share of them `mirrors`. Materials picture0, picture1, ... are the room's own."""
    for i in range(count):
        edge = a.some_edge()
        start, along, inward, length = edge_frame(a.plan.corners, edge)
        size = (float(a.rng.uniform(0.25, 1.3)), float(a.rng.uniform(0.3, 0.9)))
        if size[0] > length - 0.4:
            continue
        at = (float(a.rng.uniform(size[0] / 2 + 0.1, length - size[0] / 2 - 0.1)), float(a.rng.uniform(1.35, 1.75)))
        area = rectangle(start + at[0] * along + 0.02 * inward, (size[0], 0.03), float(np.arctan2(along[1], along[0])))
        if a.is_free(area, at[1] - size[1] / 2, at[1] + size[1] / 2):
            a.faces += hang_picture(a.plan, edge, at, size, "mirror" if a.rng.random() < mirrors else f"picture{i % 4}")
            a.clear.append((area, at[1] - size[1] / 2, at[1] + size[1] / 2))
