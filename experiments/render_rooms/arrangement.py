"""Furniture put down one piece at a time, never into walls, doorways, windows or each other."""

from dataclasses import dataclass

import numpy as np

from experiments.render_rooms.assets import Catalog, FurnitureModel, pick_model
from experiments.render_rooms.floorplan import Floorplan, Opening
from experiments.render_rooms.polygon import edge_frame, fits_inside, overlap, rectangle
from experiments.render_rooms.shell import Face

_COLOURFUL = ("sofa", "couch", "chair", "bed", "rug", "puff", "stool", "bathmat")  # in a model's name
_FREE = (99.0, 99.0, 99.0)


@dataclass(frozen=True, eq=False)
class PlacedModel:
    """A model standing (or hanging) in the room; its front looks along its own -y."""

    model: FurnitureModel
    centre: np.ndarray  # (2,) metres
    base: float  # height of its foot
    yaw: float
    size: tuple[float, float, float]
    recolour: tuple[float, float, float]  # hue shift, saturation, value

    @property
    def footprint(self) -> np.ndarray:
        """(4, 2) corners on the floor."""
        return rectangle(self.centre, self.size[:2], self.yaw)

    def to_room(self, local: tuple[float, float]) -> np.ndarray:
        """A point given in the piece's own frame."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return self.centre + np.array([c * local[0] - s * local[1], s * local[0] + c * local[1]])


class Arrangement:
    """A room while it is being furnished: what stands in it, and what must stay clear."""

    def __init__(self, rng: np.random.Generator, catalog: Catalog, plan: Floorplan):
        self.rng, self.catalog, self.plan = rng, catalog, plan
        self.placed: list[PlacedModel] = []
        self.faces: list[Face] = []
        self.lights: list[dict] = []
        self.clear = [_before(plan, opening) for opening in plan.openings]
        self._hues: dict[str, tuple[float, float, float]] = {}

    def choose(self, kind: str, most: tuple[float, float, float] = _FREE) -> FurnitureModel | None:
        """A model of `kind` by chance."""
        return pick_model(self.rng, self.catalog, kind, most)

    def is_free(self, footprint: np.ndarray, low: float, high: float, ignore: tuple[PlacedModel, ...] = ()) -> bool:
        """Whether a prism over `footprint` (4, 2) touches nothing and stays in the room."""
        if not fits_inside(self.plan.corners, footprint) or np.min(self.plan.ceiling_at(footprint)) < high + 0.01:
            return False
        if any(bottom < high and low < top and overlap(footprint, area) for area, bottom, top in self.clear):
            return False
        others = [piece for piece in self.placed if piece not in ignore]
        return not any(
            low < piece.base + piece.size[2] and piece.base < high and overlap(footprint, piece.footprint)
            for piece in others
        )

    def put(
        self,
        model: FurnitureModel | None,
        centre: np.ndarray,
        yaw: float,
        base: float | None = None,
        ignore: tuple[PlacedModel, ...] = (),
    ) -> PlacedModel | None:
        """Put `model` down where that is free; None where it is not."""
        if model is None:
            return None
        foot = model.elevation if base is None else base
        piece = PlacedModel(model, np.asarray(centre, float), foot, float(yaw), model.size, self._colour(model))
        if not self.is_free(piece.footprint, foot + 0.005, foot + model.size[2], ignore):
            return None
        self.placed.append(piece)
        return piece

    def against_wall(
        self,
        kind: str,
        most: tuple[float, float, float] = _FREE,
        facing: np.ndarray | None = None,
        at: float | None = None,
    ) -> tuple[PlacedModel, int, float] | None:
        """Put a `kind` with its back to a wall; `facing` asks for walls that look against that direction.

        Returns the piece, its wall and how far along it stands; `at` is the height of its foot."""
        for _ in range(14):
            edge = self.some_edge()
            _, _, inward, length = edge_frame(self.plan.corners, edge)
            if facing is not None and inward @ facing > -0.5:
                continue
            model = self.choose(kind, (min(most[0], length - 0.1), most[1], most[2]))
            if model is None:
                continue
            along = self._along(length, model.size[0])
            piece = self.put_on_wall(model, edge, along, at)
            if piece is not None:
                return piece, edge, along
        return None

    def put_on_wall(
        self, model: FurnitureModel | None, edge: int, along: float, base: float | None = None
    ) -> PlacedModel | None:
        """Put `model` with its back to wall `edge`, its middle `along` metres from the edge's start."""
        if model is None:
            return None
        start, direction, inward, _ = edge_frame(self.plan.corners, edge)
        hangs = (base if base is not None else model.elevation) > 0.15
        gap = 0.004 if hangs else float(self.rng.uniform(0.025, 0.05))
        centre = start + along * direction + (model.size[1] / 2 + gap) * inward
        return self.put(model, centre, float(np.arctan2(inward[0], -inward[1])), base)

    def in_middle(self, kind: str, most: tuple[float, float, float] = _FREE, margin: float = 0.7) -> PlacedModel | None:
        """Put a `kind` somewhere with `margin` metres around it."""
        for _ in range(20):
            model = self.choose(kind, most)
            if model is None:
                return None
            low, high = self.plan.corners.min(0), self.plan.corners.max(0)
            centre = low + self.rng.beta(2, 2, 2) * (high - low)
            edge = edge_frame(self.plan.corners, 0)[1]
            yaw = np.arctan2(edge[1], edge[0]) + self.rng.integers(4) * np.pi / 2
            yaw += self.rng.normal(0, 0.3) if self.rng.random() < 0.15 else 0.0
            around = rectangle(centre, (model.size[0] + 2 * margin, model.size[1] + 2 * margin), yaw)
            if self.is_free(around, 0.005, model.size[2]):
                return self.put(model, centre, yaw)
        return None

    def beside(
        self, piece: PlacedModel, model: FurnitureModel | None, local: tuple[float, float], turn: float
    ) -> PlacedModel | None:
        """Put `model` at a point of `piece`'s own frame, turned against it by `turn` radians; they may overlap."""
        return self.put(model, piece.to_room(local), piece.yaw + turn, ignore=(piece,))

    def on_top(self, piece: PlacedModel, kind: str, most: float = 0.7) -> PlacedModel | None:
        """Put a small `kind` onto `piece`."""
        if piece.model.top is None:
            return None
        w, d, _ = piece.size
        model = self.choose(kind, (most * w, most * d, 1.2))
        if model is None:
            return None
        room = np.array([w - model.size[0], d - model.size[1]]) * 0.42
        local = self.rng.uniform(-room, room)
        turn = self.rng.normal(0, 0.25)
        base = piece.base + piece.model.top * piece.size[2] / piece.model.size[2]
        return self.put(model, piece.to_room((local[0], local[1])), piece.yaw + turn, base, (piece,))

    def hang(self, kind: str, centre: np.ndarray, lowest: float = 1.9) -> PlacedModel | None:
        """Hang a `kind` from the ceiling, shortened to keep `lowest` metres free below."""
        model = self.choose(kind)
        height = float(np.min(self.plan.ceiling_at(rectangle(centre, model.size[:2], 0))))
        share = min(1.0, (height - lowest) / model.size[2])
        if share < 0.35 or len(self.plan.ceiling) > 1 or np.any(self.plan.ceiling[:, :2]):
            return None
        size = tuple(share * side for side in model.size)
        piece = PlacedModel(model, np.asarray(centre, float), height - size[2], 0.0, size, self._colour(model))
        if not self.is_free(piece.footprint, piece.base, height - 0.02):
            return None
        self.placed.append(piece)
        return piece

    def some_edge(self) -> int:
        """A wall by chance, long ones more often."""
        lengths = np.array([edge_frame(self.plan.corners, edge)[3] for edge in range(len(self.plan.corners))])
        return int(self.rng.choice(len(lengths), p=lengths**1.5 / np.sum(lengths**1.5)))

    def _along(self, length: float, width: float) -> float:
        low, high = width / 2 + 0.03, length - width / 2 - 0.03
        if self.rng.random() < 0.3:  # into a corner
            return low if self.rng.random() < 0.5 else high
        return float(self.rng.uniform(low, high))

    def _colour(self, model: FurnitureModel) -> tuple[float, float, float]:
        if model.key not in self._hues:
            colourful = any(word in model.credit[0].lower() for word in _COLOURFUL)
            bold = colourful and self.rng.random() < 0.5
            hue = self.rng.uniform(-0.5, 0.5) if bold else self.rng.normal(0, 0.015)
            self._hues[model.key] = (float(hue), float(self.rng.uniform(0.6, 1.15)), float(self.rng.uniform(0.7, 1.15)))
        return self._hues[model.key]


def _before(plan: Floorplan, opening: Opening) -> tuple[np.ndarray, float, float]:
    """What must stay free in front of an opening: an area of floor between two heights."""
    start, along, inward, _ = edge_frame(plan.corners, opening.edge)
    deep = 0.22 if opening.kind == "window" else 0.85
    middle = start + (opening.start + opening.width / 2) * along + deep / 2 * inward
    wide = opening.width + (0.4 if opening.kind == "window" else 0.1)  # curtains, casings
    area = rectangle(middle, (wide, deep), float(np.arctan2(along[1], along[0])))
    return area, opening.bottom + 0.02, opening.top
