"""One room by seed: plan, furniture, materials, light and cameras as a plain dictionary that Blender can draw."""

from dataclasses import dataclass, replace

import numpy as np

from experiments.render_rooms.arrangement import Arrangement, PlacedModel
from experiments.render_rooms.assets import Catalog
from experiments.render_rooms.finishes import draw_materials, draw_picture
from experiments.render_rooms.fittings import draw_fittings
from experiments.render_rooms.floorplan import Floorplan, Opening, draw_floorplan
from experiments.render_rooms.lighting import ceiling_lights, daylight, draw_world, lit_material
from experiments.render_rooms.polygon import polygon_area
from experiments.render_rooms.shell import Face, shell_faces
from experiments.render_rooms.styles import STYLES, furnish
from experiments.render_rooms.viewpoints import draw_viewpoints, draw_walk

_TEXTURE_CREDIT = ("Textures", "Emmanuel Puybaret / eTeks", "Sweet Home 3D default textures", "GPL-2.0 or later")
_WORLD_CREDIT = ("Surroundings", "Poly Haven, by way of Blender", "Blender studio lights", "CC0")


@dataclass(frozen=True)
class ShotList:
    """Which panoramas a room gets."""

    views: int = 3  # wished for; a small or full room has fewer
    height: int = 128  # pixels; the width is twice that
    fine_height: int = 0  # pixels of a finer copy of the first panorama, or 0
    walk_frames: int = 0  # at most, in a straight walk; 0 for none


def plan_room(seed: int, catalog: Catalog, shots: ShotList) -> dict:
    """Room `seed`: the same for ever. Lengths are metres in the room's own frame: floor at z = 0, z up."""
    rng = np.random.default_rng([seed, 20])
    while True:
        style, arrangement, night = _furnished_plan(rng, catalog)
        viewpoints = draw_viewpoints(arrangement, shots.views)
        if viewpoints:
            break
    plan = arrangement.plan
    world = draw_world(rng, night)
    faces, materials, rooms = _all_faces(rng, catalog, arrangement, STYLES[style][3])
    lights = [light for room in rooms for light in room.lights] + daylight(rng, plan, world)
    pieces = [piece for room in rooms for piece in room.placed]
    walk = draw_walk(arrangement, viewpoints[0], shots.walk_frames) if shots.walk_frames else []
    return {
        "seed": seed, "style": style, "panoramas": _panoramas(viewpoints, walk, shots),
        "corners": plan.corners.tolist(), "ceiling": plan.ceiling.tolist(),
        "size": [*np.ptp(plan.corners, axis=0).tolist(), float(plan.ceiling_at(plan.corners).max())],
        "openings": [_opening_record(plan, opening) for opening in plan.openings],
        "materials": materials, "faces": [_face_record(face) for face in faces],
        "models": [_model_record(piece) for piece in pieces], "lights": lights, "world": world,
        "look": _draw_look(rng), "credits": _credits(pieces),
    }  # fmt: skip


def _panoramas(viewpoints: list[dict], walk: list[dict], shots: ShotList) -> list[dict]:
    """Name, pixels and pose of each; `room_from_panorama` has +x through the centre column, +y left, +z up."""
    named = [(f"{number:03d}", shots.height, view) for number, view in enumerate(viewpoints)]
    if shots.fine_height:
        named.append(("000_fine", shots.fine_height, viewpoints[0]))
    if len(walk) > 4:
        named += [(f"walk_{number:03d}", shots.height, view) for number, view in enumerate(walk)]
    return [
        {"name": name, "height": height, "camera_height": view["place"][2], "room_from_panorama": _pose(view), **view}
        for name, height, view in named
    ]


def _pose(view: dict) -> list[list[float]]:
    c, s = float(np.cos(view["yaw"])), float(np.sin(view["yaw"]))
    x, y, z = view["place"]
    return [[c, -s, 0.0, x], [s, c, 0.0, y], [0.0, 0.0, 1.0, z], [0.0, 0.0, 0.0, 1.0]]


def _furnished_plan(rng: np.random.Generator, catalog: Catalog) -> tuple[str, Arrangement, bool]:
    odds = np.array([style[0] for style in STYLES.values()])
    style = str(rng.choice(list(STYLES), p=odds / odds.sum()))
    _, low, high, _ = STYLES[style]
    size = low + rng.beta(1.3, 1.9, 2) * (high - low)
    daylit = rng.random() < (0.45 if style in ("bathroom", "store", "hall") else 0.9)
    plan = draw_floorplan(rng, (float(size[0]), float(size[1])), daylit)
    arrangement = Arrangement(rng, catalog, plan)
    night = bool(rng.random() < 0.12)
    furnish(arrangement, style)
    has_window = any(opening.kind == "window" for opening in plan.openings)
    ceiling_lights(arrangement, 0.6 if has_window and not night else 1.0)
    return style, arrangement, night


def _all_faces(
    rng: np.random.Generator, catalog: Catalog, arrangement: Arrangement, damp: str
) -> tuple[list[Face], dict[str, dict], list[Arrangement]]:
    """Faces and materials of the room and of those beyond its doors, which are furnished a little."""
    plan = arrangement.plan
    materials = draw_materials(rng, catalog, damp) | {f"picture{i}": draw_picture(rng) for i in range(4)}
    faces = shell_faces(plan, {name: name for name in ("floor", "ceiling", "wall", "accent", "frame")})
    faces += draw_fittings(rng, plan, damp == "dry") + arrangement.faces
    rooms = [arrangement]
    for number, annex in enumerate(plan.annexes):
        other = _furnish_annex(rng, catalog, annex)
        fresh = draw_materials(rng, catalog, "dry")
        same_floor = rng.random() < 0.4
        names = {name: f"{name}_{number}" for name in ("floor", "ceiling", "wall", "accent")} | {"frame": "frame"}
        materials |= {names[name]: fresh[name] for name in ("floor", "ceiling", "wall", "accent")}
        materials[names["floor"]] = materials["floor"] if same_floor else fresh["floor"]
        faces += shell_faces(annex, names) + draw_fittings(rng, annex, False) + other.faces
        rooms.append(other)
    materials["lit"] = lit_material(rng, faces, polygon_area(plan.corners))
    return faces, materials, rooms


def _furnish_annex(rng: np.random.Generator, catalog: Catalog, annex: Floorplan) -> Arrangement:
    arrangement = Arrangement(rng, catalog, replace(annex))
    kinds = ("bookcase", "sideboard", "sofa", "plant", "wardrobe", "bed", "armchair", "kitchen_low", "desk", "chair")
    for _ in range(int(rng.integers(1, 5))):
        arrangement.against_wall(str(rng.choice(kinds)))
    ceiling_lights(arrangement, 0.75)
    return arrangement


def _draw_look(rng: np.random.Generator) -> dict:
    """How the photograph is developed: stops about the automatic exposure, contrast, part of white balance done."""
    return {
        "stops": float(np.clip(rng.normal(0.05, 0.35), -0.8, 0.8)), "shoulder": float(rng.uniform(0.3, 1.0)),
        "balance": float(rng.uniform(0.3, 0.95)), "saturation": float(rng.uniform(0.85, 1.15)),
    }  # fmt: skip


def _opening_record(plan: Floorplan, opening: Opening) -> dict:
    return {
        "kind": opening.kind, "edge": opening.edge, "start": opening.start, "width": opening.width,
        "bottom": opening.bottom, "top": opening.top,
    }  # fmt: skip


def _face_record(face: Face) -> dict:
    return {"material": face.material, "corners": face.corners.tolist(), "part": face.part}


def _model_record(piece: PlacedModel) -> dict:
    model = piece.model
    return {
        "key": model.key, "path": model.path, "place": [*map(float, piece.centre), float(piece.base)],
        "yaw": piece.yaw, "size": list(piece.size), "full_size": list(model.size), "rotation": model.rotation,
        "recolour": list(piece.recolour),
    }  # fmt: skip


def _credits(pieces: list[PlacedModel]) -> list[list[str]]:
    """Name, author, source, licence of all that is shown."""
    return [
        list(credit) for credit in sorted({piece.model.credit for piece in pieces} | {_TEXTURE_CREDIT, _WORLD_CREDIT})
    ]
