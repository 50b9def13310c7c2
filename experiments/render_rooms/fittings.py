"""What is fixed to walls: skirting, window frames, sills, door leaves and casings, curtains, blinds, pictures."""

from dataclasses import dataclass

import numpy as np

from experiments.render_rooms.floorplan import Floorplan, Opening
from experiments.render_rooms.polygon import edge_frame, rectangle
from experiments.render_rooms.shell import Face, as_part

_SIDES = ((0, 1, 2, 3), (7, 6, 5, 4), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0))


@dataclass(frozen=True)
class WallFrame:
    """Coordinates on one wall: metres along the edge, out of the wall into the room, up."""

    start: np.ndarray
    along: np.ndarray
    inward: np.ndarray

    @classmethod
    def of_edge(cls, plan: Floorplan, edge: int) -> "WallFrame":
        """The frame of wall `edge`."""
        return cls(*edge_frame(plan.corners, edge)[:3])

    def box(self, material: str, low: tuple[float, float, float], high: tuple[float, float, float]) -> list[Face]:
        """A box between two corners given in this frame."""
        (a0, n0, z0), (a1, n1, z1) = low, high
        base = [self.start + a * self.along + n * self.inward for a, n in ((a0, n0), (a1, n0), (a1, n1), (a0, n1))]
        return prism(material, np.array(base), z0, z1)


def prism(material: str, base: np.ndarray, low: float, high: float) -> list[Face]:
    """The six faces over a quadrilateral (4, 2) from height `low` to `high`."""
    corners = np.concatenate([np.c_[base, np.full(4, low)], np.c_[base, np.full(4, high)]])
    return [Face(material, corners[list(side)]) for side in _SIDES]


def draw_fittings(rng: np.random.Generator, plan: Floorplan, dressed: bool) -> list[Face]:
    """Skirting, frames, doors of `plan` and, where it is `dressed`, curtains and blinds."""
    height = float(rng.uniform(0.05, 0.16)) if rng.random() < 0.85 else 0.0
    faces = _skirting(plan, height, float(rng.uniform(0.008, 0.02))) if height else []
    curtain = rng.random() < 0.5 and dressed
    blind = rng.random() < 0.2 and dressed
    for opening in plan.openings:
        if opening.kind == "window":
            faces += _window(rng, plan, opening)
            faces += as_part(_curtains(rng, plan, opening), "furniture") if curtain else []
            faces += as_part(_blind(rng, plan, opening), "furniture") if blind else []
        elif opening.kind != "hole":
            faces += _casing(plan, opening) if rng.random() < 0.8 else []
            faces += _leaf(plan, opening) if opening.kind in ("door", "ajar") else []
    return faces


def _skirting(plan: Floorplan, height: float, thick: float) -> list[Face]:
    faces = []
    for edge in range(len(plan.corners)):
        length = edge_frame(plan.corners, edge)[3]
        frame = WallFrame.of_edge(plan, edge)
        doors = sorted((o.start, o.start + o.width) for o in plan.openings if o.edge == edge and o.bottom < height)
        at = 0.0
        for left, right in [*doors, (length, length)]:
            if left - at > 0.02:
                faces += frame.box("skirting", (at, 0, 0), (left, thick, height))
            at = right
    return faces


def _window(rng: np.random.Generator, plan: Floorplan, window: Opening) -> list[Face]:
    """A frame with bars at the outer end of the reveal, and a sill."""
    frame = WallFrame.of_edge(plan, window.edge)
    a, b, low, high = window.start, window.start + window.width, window.bottom, window.top
    out, back, rim = -window.depth + 0.07, -window.depth, float(rng.uniform(0.04, 0.08))
    rails = [(a, low, b, low + rim), (a, high - rim, b, high), (a, low, a + rim, high), (b - rim, low, b, high)]
    columns = max(1, round(window.width / rng.uniform(0.5, 1.3)))
    rows = 1 if rng.random() < 0.6 else int(rng.integers(2, 4))
    bar = float(rng.uniform(0.02, 0.07))
    for i in range(1, columns):
        at = a + i * window.width / columns
        rails.append((at - bar / 2, low, at + bar / 2, high))
    for i in range(1, rows):
        at = low + i * (high - low) / rows
        rails.append((a, at - bar / 2, b, at + bar / 2))
    faces = [f for left, z0, right, z1 in rails for f in frame.box("window", (left, back, z0), (right, out, z1))]
    if low > 0.3:
        faces += frame.box("sill", (a - 0.04, -window.depth, low - 0.03), (b + 0.04, 0.04, low + 0.001))
    return faces


def _casing(plan: Floorplan, door: Opening) -> list[Face]:
    frame = WallFrame.of_edge(plan, door.edge)
    a, b, high, wide = door.start, door.start + door.width, door.top, 0.07
    faces = frame.box("frame", (a - wide, 0, 0), (a, 0.018, high + wide))
    faces += frame.box("frame", (b, 0, 0), (b + wide, 0.018, high + wide))
    return faces + frame.box("frame", (a, 0, high), (b, 0.018, high + wide))


def _leaf(plan: Floorplan, door: Opening) -> list[Face]:
    """A closed leaf behind the wall's face, or one that swings into the room beyond."""
    frame = WallFrame.of_edge(plan, door.edge)
    hinge = frame.start + (door.start + 0.01) * frame.along - (door.depth - 0.03) * frame.inward
    angle = np.arctan2(frame.along[1], frame.along[0]) - (door.swing if door.kind == "ajar" else 0.0)
    if door.kind == "door":
        hinge = hinge + (door.depth - 0.09) * frame.inward
    along = np.array([np.cos(angle), np.sin(angle)])
    across = np.array([-along[1], along[0]])
    leaf = WallFrame(hinge, along, across)
    wide, high = door.width - 0.02, door.top - 0.01
    faces = leaf.box("door", (0, -0.02, 0.005), (wide, 0.02, high))
    for low, top in ((0.12, 0.48), (0.54, 0.94)):
        faces += leaf.box("door", (0.12, -0.03, low * high), (wide - 0.12, 0.03, top * high))
    return faces + leaf.box("metal", (wide - 0.14, -0.07, 1.0), (wide - 0.03, 0.07, 1.025))


def _curtains(rng: np.random.Generator, plan: Floorplan, window: Opening) -> list[Face]:
    frame = WallFrame.of_edge(plan, window.edge)
    length = edge_frame(plan.corners, window.edge)[3]
    drawn = float(rng.uniform(0.12, 0.4)) * window.width
    top = min(window.top + 0.15, float(plan.ceiling_at((frame.start + frame.along * length / 2)[None])[0]) - 0.02)
    foot = 0.03 if rng.random() < 0.7 else max(window.bottom - 0.15, 0.03)
    reach = (max(window.start - 0.25, 0.02), min(window.start + window.width + 0.25, length - 0.02))
    faces = frame.box("metal", (reach[0], 0.09, top), (reach[1], 0.11, top + 0.02))
    faces += _hanging(frame, (reach[0], window.start + drawn), (foot, top), float(rng.uniform(0.09, 0.18)))
    return faces + _hanging(
        frame, (window.start + window.width - drawn, reach[1]), (foot, top), float(rng.uniform(0.09, 0.18))
    )


def _hanging(frame: WallFrame, span: tuple[float, float], heights: tuple[float, float], fold: float) -> list[Face]:
    """A curtain: a sheet in waves of length `fold`."""
    at = np.linspace(*span, max(8, round(8 * (span[1] - span[0]) / fold)))
    out = 0.1 + 0.035 * np.sin(2 * np.pi * at / fold)
    foot = frame.start + at[:, None] * frame.along + out[:, None] * frame.inward
    low, high = np.c_[foot, np.full(len(at), heights[0])], np.c_[foot, np.full(len(at), heights[1])]
    return [Face("curtain", np.array([low[i], low[i + 1], high[i + 1], high[i]])) for i in range(len(at) - 1)]


def _blind(rng: np.random.Generator, plan: Floorplan, window: Opening) -> list[Face]:
    frame = WallFrame.of_edge(plan, window.edge)
    low = window.top - rng.uniform(0.15, 0.7) * (window.top - window.bottom)
    inset = -window.depth + 0.09
    return frame.box(
        "blind", (window.start + 0.01, inset, low), (window.start + window.width - 0.01, inset + 0.01, window.top)
    )


def hang_picture(
    plan: Floorplan, edge: int, at: tuple[float, float], size: tuple[float, float], name: str
) -> list[Face]:
    """A framed picture (or mirror) of material `name`, centred `at` metres along the wall and up."""
    frame = WallFrame.of_edge(plan, edge)
    (a, z), (w, h), rim = at, (size[0] / 2, size[1] / 2), 0.02 + 0.03 * size[0]
    faces = frame.box("picture_frame", (a - w, 0.002, z - h), (a + w, 0.02, z + h))
    left, right = (frame.start + (a + s * (w - rim)) * frame.along + 0.0215 * frame.inward for s in (-1, 1))
    low, high = z - h + rim, z + h - rim
    inside = Face(name, np.array([[*right, low], [*left, low], [*left, high], [*right, high]]))
    return as_part([*faces, inside], "flat")


def lay_rug(centre: np.ndarray, size: tuple[float, float], yaw: float) -> list[Face]:
    """A flat rug on the floor."""
    return as_part(prism("rug", rectangle(centre, size, yaw), 0.0, 0.012), "flat")
