"""A catalog without files: one model of plausible size for every kind."""

from experiments.render_rooms.assets import Catalog, FurnitureModel, PhotoTexture
from experiments.render_rooms.kinds import MODEL_KINDS

_SIZES = {"sofa": (1.9, 0.9, 0.8), "bed": (1.6, 2.1, 0.9), "dining_table": (1.5, 0.9, 0.75), "pendant": (0.4, 0.4, 0.8)}


def _model(kind: str) -> FurnitureModel:
    size = _SIZES.get(kind, (0.5, 0.45, 0.8))
    key = "B:" + kind
    hangs = 1.45 if kind in ("kitchen_up", "kitchen_hood", "wall_lamp") else 0.0
    return FurnitureModel(key, f"/nowhere/{kind}.obj", size, hangs, size[2], None, (kind, "A. Maker", "Library", "CC0"))


def paper_catalog() -> Catalog:
    """Models that exist on paper only: for planning, not for rendering."""
    textures = tuple(
        PhotoTexture(place.lower(), f"/nowhere/{place}.jpg", (0.4, 0.4), place) for place in ("Floor", "Wall")
    )
    return Catalog({kind: (_model(kind),) for kind in MODEL_KINDS}, textures)
