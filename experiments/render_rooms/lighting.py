"""Daylight through windows, the sun, lamps at the ceiling, the view outside. Only ratios matter: exposure follows."""

import numpy as np

from experiments.render_rooms.arrangement import Arrangement
from experiments.render_rooms.fittings import prism
from experiments.render_rooms.floorplan import Floorplan
from experiments.render_rooms.groups import hanging_lamp, lamp_light
from experiments.render_rooms.polygon import edge_frame, inside, polygon_area, rectangle, wall_clearance
from experiments.render_rooms.shell import as_part

_DAY_WORLDS = ("city", "forest", "sunrise", "courtyard", "sunset")


def draw_world(rng: np.random.Generator, night: bool) -> dict:
    """What windows show: one of Blender's photographed surroundings, turned, at a strength that may blow out."""
    name = "night" if night else str(rng.choice(_DAY_WORLDS))
    strength = rng.uniform(0.1, 0.4) if night else 10 ** rng.uniform(-0.1, 0.9)
    return {"image": name, "turn": float(rng.uniform(0, 2 * np.pi)), "strength": float(strength)}


def daylight(rng: np.random.Generator, plan: Floorplan, world: dict) -> list[dict]:
    """One area light behind each window, as bright as the sky it stands for, and sometimes the sun."""
    windows = [(room, o) for room in (plan, *plan.annexes) for o in room.openings if o.kind == "window"]
    warmth = rng.uniform(0.85, 1.1)
    colour = [float(warmth), 0.97, float(1.95 - warmth)]
    lights = []
    for room, window in windows:
        start, along, inward, _ = edge_frame(room.corners, window.edge)
        middle = start + (window.start + window.width / 2) * along - (window.depth + 0.03) * inward
        height = window.top - window.bottom
        radiance = world["strength"] * rng.uniform(1.0, 2.2)
        lights.append({
            "kind": "area", "place": [*map(float, middle), float(window.bottom + height / 2)],
            "towards": [*map(float, inward), -0.25], "size": [window.width, height], "colour": colour,
            "power": float(np.pi * window.width * height * radiance),
        })  # fmt: skip
    if windows and world["image"] != "night" and rng.random() < 0.45:
        lights.append(_sun(rng, windows[rng.integers(len(windows))], world["strength"]))
    return lights


def _sun(rng: np.random.Generator, through: tuple, strength: float) -> dict:
    """A sun that shines into the room through a given window."""
    plan, window = through
    inward = edge_frame(plan.corners, window.edge)[2]
    turn, low = rng.normal(0, 0.6), np.tan(rng.uniform(0.25, 1.0))
    c, s = np.cos(turn), np.sin(turn)
    heading = np.array([c * inward[0] - s * inward[1], s * inward[0] + c * inward[1], -low])
    power = strength * rng.uniform(3, 9)
    return {
        "kind": "sun",
        "towards": heading.tolist(),
        "power": float(power),
        "colour": [1.0, 0.9, 0.78],
        "angle": 0.01,
    }


def ceiling_lights(a: Arrangement, wanted: float) -> None:
    """A pendant, a lamp under the ceiling, bright panels or small spots, with the odds `wanted` of any light."""
    if a.rng.random() > wanted:
        return
    area = polygon_area(a.plan.corners)
    middle = _middle(a.plan)
    chance = a.rng.random()
    if chance < 0.3:
        hanging_lamp(a, middle)
    elif chance < 0.5 and (lamp := a.hang("ceiling_lamp", middle)):
        lamp_light(a, lamp, -0.05, area * a.rng.uniform(3, 10))
    elif not np.any(a.plan.ceiling[:, :2]):
        _panels(a)
    if not a.lights and not any(face.material == "lit" for face in a.faces):
        _bare_bulb(a, middle)


def _middle(plan: Floorplan) -> np.ndarray:
    """A place well inside the floor: of a fine grid, the one farthest from all walls."""
    low, high = plan.corners.min(0), plan.corners.max(0)
    grid = low + (np.stack(np.meshgrid(*[np.linspace(0, 1, 25)] * 2), -1).reshape(-1, 2)) * (high - low)
    grid = grid[inside(plan.corners, grid)]
    return grid[np.argmax(wall_clearance(plan.corners, grid))]


def _bare_bulb(a: Arrangement, middle: np.ndarray) -> None:
    height = float(a.plan.ceiling_at(middle[None])[0])
    low = max(height - 0.6, min(1.9, height - 0.3))
    bulb = prism("lit", rectangle(middle, (0.2, 0.2), 0.3), low, low + 0.18)
    stem = prism("metal", rectangle(middle, (0.015, 0.015), 0.3), low + 0.18, height)
    a.faces += as_part(bulb + stem, "furniture")


def _panels(a: Arrangement) -> None:
    """Bright squares or long strips in a grid over the floor."""
    height = float(a.plan.ceiling[0, 2])
    size = [(0.6, 0.6), (1.2, 0.3), (0.12, 0.12), (0.35, 0.35), (1.2, 0.1)][a.rng.integers(5)]
    low, high = a.plan.corners.min(0), a.plan.corners.max(0)
    spacing = float(a.rng.uniform(1.5, 2.6))
    counts = np.maximum(1, np.round((high - low) / spacing)).astype(int)
    if a.rng.random() < 0.35:
        counts = np.minimum(counts, 1)
    for i in range(counts[0]):
        for j in range(counts[1]):
            spot = low + (np.array([i, j]) + 0.5) / counts * (high - low)
            base = rectangle(spot, size, 0.0)
            if a.is_free(base, height - 0.08, height - 0.05):
                a.faces += prism("lit", base, height - 0.03, height - 0.004)


def lit_material(rng: np.random.Generator, faces: list, area: float) -> dict:
    """The material of bright panels: the fewer and smaller they are, the brighter."""
    lit = 0.0
    for face in faces:
        if face.material == "lit":
            lit += 0.5 * float(
                np.linalg.norm(np.cross(face.corners[2] - face.corners[0], face.corners[3] - face.corners[1]))
            )
    radiance = area * rng.uniform(0.4, 1.6) / max(lit, 0.05)
    warm = rng.uniform(0, 1)
    return {
        "kind": "lit",
        "colour": [1.0, 0.95 - 0.2 * warm, 0.95 - 0.5 * warm],
        "strength": float(min(radiance, 25.0)),
    }
