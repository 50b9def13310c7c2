"""Materials by chance: photographed textures, drawn patterns and plain colours, each a small dictionary for Blender."""

import numpy as np

from experiments.render_rooms.assets import Catalog, PhotoTexture

_FLOORS = ("photo", "planks", "tiles", "carpet", "plain", "terrazzo")
_FLOOR_ODDS = {"dry": (0.36, 0.28, 0.1, 0.14, 0.06, 0.06), "wet": (0.5, 0.08, 0.3, 0.0, 0.04, 0.08)}
_WALLS = ("plain", "plaster", "photo", "stripes", "tiles", "brick")
_WALL_ODDS = {"dry": (0.52, 0.22, 0.09, 0.08, 0.02, 0.07), "wet": (0.2, 0.1, 0.25, 0.0, 0.42, 0.03)}
_WOODS = ((0.42, 0.26, 0.14), (0.55, 0.38, 0.22), (0.25, 0.14, 0.08), (0.62, 0.5, 0.36), (0.36, 0.3, 0.26))
_OUTDOOR = {"grass", "boxTree", "pavingStone", "pebbles"}


def draw_materials(rng: np.random.Generator, catalog: Catalog, damp: str) -> dict[str, dict]:
    """All materials of a room by name; `damp` is "dry" or "wet" (kitchens, bathrooms)."""
    wall = _wall(rng, catalog, damp)
    accent = _wall(rng, catalog, "dry") if rng.random() < 0.2 else wall
    white = _plain(_tinted(rng, 0.75, 0.9, 0.05), rng.uniform(0.3, 0.6))
    wood = _plain(tuple(np.array(_WOODS[rng.integers(len(_WOODS))]) * rng.uniform(0.6, 1.2)), 0.45)
    trim = white if rng.random() < 0.7 else wood
    return {
        "floor": _floor(rng, catalog, damp),
        "ceiling": _ceiling(rng, catalog),
        "wall": wall,
        "accent": accent,
        "frame": trim,
        "skirting": trim if rng.random() < 0.8 else wood,
        "window": white if rng.random() < 0.7 else _plain(_tinted(rng, 0.03, 0.4, 0.2), 0.4),
        "sill": white,
        "door": trim if rng.random() < 0.6 else wood,
        "metal": {"kind": "metal", "colour": [0.6, 0.58, 0.55], "roughness": 0.35},
        "curtain": _cloth(rng),
        "blind": _plain(_tinted(rng, 0.4, 0.9, 0.3), 0.9),
        "rug": _cloth(rng),
        "picture_frame": _plain(_tinted(rng, 0.02, 0.8, 0.3), 0.4),
        "mirror": {"kind": "mirror"},
    }


def draw_picture(rng: np.random.Generator) -> dict:
    """What hangs in a frame: a cut of a photograph of the world outside, or something abstract."""
    if rng.random() < 0.5:
        worlds = ("city", "forest", "sunset", "sunrise", "courtyard", "interior")
        corner = [float(rng.uniform(0, 0.8)), float(rng.uniform(0.35, 0.55))]
        return {
            "kind": "photograph",
            "world": str(rng.choice(worlds)),
            "corner": corner,
            "share": float(rng.uniform(0.08, 0.25)),
        }
    colours = [list(_tinted(rng, 0.05, 0.9, 0.9)) for _ in range(4)]
    pattern = str(rng.choice(["voronoi", "noise", "wave", "magic"]))
    return {"kind": "abstract", "pattern": pattern, "scale": float(rng.uniform(2, 9)), "colours": colours}


def _tinted(rng: np.random.Generator, low: float, high: float, saturation: float) -> tuple[float, float, float]:
    """A linear colour of brightness `low` to `high`, tinted by at most `saturation`."""
    tint = rng.uniform(1 - saturation, 1, 3)
    colour = rng.uniform(low, high) * tint / tint.max()
    return float(colour[0]), float(colour[1]), float(colour[2])


def _plain(colour: tuple[float, ...], roughness: float) -> dict:
    return {"kind": "plain", "colour": [float(c) for c in colour], "roughness": float(roughness)}


def _photo(rng: np.random.Generator, texture: PhotoTexture) -> dict:
    zoom = rng.uniform(0.8, 2.2)
    recolour = [float(rng.normal(0, 0.02)), float(rng.uniform(0.5, 1.1)), float(rng.uniform(0.6, 1.15))]
    size = [zoom * side for side in texture.size]
    turned = float(rng.choice([0, 0.5])) * np.pi if texture.place == "Floor" else 0.0
    return {
        "kind": "photo",
        "path": texture.path,
        "size": size,
        "recolour": recolour,
        "angle": turned,
        "roughness": float(rng.uniform(0.2, 0.7)),
    }


def _drawn(rng: np.random.Generator, kind: str, colour: tuple[float, ...], size: tuple[float, float]) -> dict:
    second = np.clip(np.array(colour) * rng.uniform(0.6, 1.3) + rng.normal(0, 0.02, 3), 0.01, 0.92)
    mortar = _tinted(rng, 0.1, 0.8, 0.1) if kind in ("tiles", "brick") else tuple(0.3 * np.array(colour))
    pattern = {"kind": kind, "colour": [float(c) for c in colour], "second": second.tolist()}
    pattern |= {"mortar": [float(c) for c in mortar], "size": [float(s) for s in size]}
    return pattern | {
        "angle": float(rng.choice([0, 0.5]) * np.pi),
        "roughness": float(rng.uniform(0.15, 0.8)),
        "seed": float(rng.uniform(0, 50)),
    }


def _floor(rng: np.random.Generator, catalog: Catalog, damp: str) -> dict:
    kind = str(rng.choice(_FLOORS, p=_FLOOR_ODDS[damp]))
    if kind == "photo":
        return _photo(rng, _choose_photo(rng, catalog, "Floor"))
    if kind == "planks":
        wood = np.array(_WOODS[rng.integers(len(_WOODS))]) * rng.uniform(0.5, 1.3)
        return _drawn(rng, "planks", tuple(wood), (rng.uniform(0.5, 2.0), rng.uniform(0.07, 0.22)))
    if kind == "tiles":
        side = rng.uniform(0.15, 0.8)
        return _drawn(rng, "tiles", _tinted(rng, 0.1, 0.8, 0.25), (side, side)) | {
            "angle": float(rng.choice([0, 0.25]) * np.pi)
        }
    return _drawn(rng, kind, _tinted(rng, 0.08, 0.7, 0.3 if kind == "carpet" else 0.15), (0.05, 0.05))


def _wall(rng: np.random.Generator, catalog: Catalog, damp: str) -> dict:
    kind = str(rng.choice(_WALLS, p=_WALL_ODDS[damp]))
    if kind == "photo":
        return _photo(rng, _choose_photo(rng, catalog, "Wall"))
    colour = _tinted(rng, 0.3, 0.85, float(rng.choice([0.12, 0.3, 0.65], p=[0.6, 0.28, 0.12])))
    if kind == "plain":
        return _plain(colour, rng.uniform(0.5, 0.95))
    sizes = {
        "plaster": (0.3, 0.3),
        "stripes": (rng.uniform(0.04, 0.4), 1),
        "tiles": (rng.uniform(0.08, 0.4),) * 2,
        "brick": (0.22, 0.07),
    }
    return _drawn(rng, kind, colour, sizes[kind]) | {"angle": 0.0}


def _choose_photo(rng: np.random.Generator, catalog: Catalog, place: str) -> PhotoTexture:
    fitting = [texture for texture in catalog.textures if texture.place == place and texture.name not in _OUTDOOR]
    return fitting[rng.integers(len(fitting))]


def _ceiling(rng: np.random.Generator, catalog: Catalog) -> dict:
    chance = rng.random()
    if chance < 0.8:
        return _plain(_tinted(rng, 0.6, 0.88, 0.06), 0.9)
    if chance < 0.88:
        return _drawn(rng, "planks", _WOODS[rng.integers(len(_WOODS))], (3.0, rng.uniform(0.08, 0.2)))
    if chance < 0.95:
        return _drawn(rng, "tiles", _tinted(rng, 0.6, 0.85, 0.05), (0.6, 0.6)) | {"angle": 0.0}
    return _plain(_tinted(rng, 0.3, 0.8, 0.5), 0.9)


def _cloth(rng: np.random.Generator) -> dict:
    kind = str(rng.choice(["plain", "carpet", "stripes", "abstract"], p=[0.4, 0.2, 0.2, 0.2]))
    if kind == "plain":
        return _plain(_tinted(rng, 0.1, 0.85, 0.6), 0.95)
    if kind == "abstract":
        return draw_picture(rng) | {
            "kind": "abstract",
            "pattern": "voronoi",
            "scale": float(rng.uniform(2, 9)),
            "colours": [list(_tinted(rng, 0.05, 0.7, 0.7)) for _ in range(4)],
        }
    return _drawn(rng, kind, _tinted(rng, 0.1, 0.8, 0.6), (rng.uniform(0.05, 0.3), 0.05))
