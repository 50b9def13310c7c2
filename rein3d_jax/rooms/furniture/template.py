"""Furniture as tables: a piece is a list of parts, each a shape between bounds (bounds.py)."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from rein3d_jax.rooms.furniture.bounds import Bounds, M

BOX, CYLINDER, ELLIPSOID = 0, 1, 2
MAX_PARTS = 32  # of a piece
MAX_TEXTURES = 4  # of a piece
_Range = tuple[float, float]


@dataclass(frozen=True)
class Part:
    """A box, or an upright elliptic cylinder or an ellipsoid inscribed in it."""

    shape: int
    texture: int  # index into the piece's textures
    x: Bounds
    y: Bounds
    z: Bounds
    chance: float = 1.0  # that it is there
    casts: bool = True  # a shadow; not what glows or lies close on another part


box, cylinder, ball = (partial(Part, shape) for shape in (BOX, CYLINDER, ELLIPSOID))


@dataclass(frozen=True)
class Piece:
    """A kind of furniture. Where it goes:
    wall     its back at a wall, on the floor       free     anywhere on the floor, at any yaw
    hung     its back at a wall, at `lift`          flat     anywhere on the floor, under everything
    ceiling  anywhere under the ceiling"""

    place: str
    width: _Range  # metres
    depth: _Range
    height: _Range
    textures: tuple[str, ...]  # names in materials.GROUPS
    parts: tuple[Part, ...]
    lift: _Range = (0.0, 0.0)  # metres from the floor to its lower end; from the ceiling to its upper end


def legs(texture: int, x: Bounds, y: Bounds, top: np.ndarray, thick: float = 0.05) -> tuple[Part, ...]:
    """Four square legs inside the corners of x and y, from the floor to `top`."""
    t = thick * M
    sides = [[(b[0], b[0] + t), (b[1] - t, b[1])] for b in (x, y)]
    return tuple(box(texture, i, j, (0 * M, top)) for i in sides[0] for j in sides[1])


def move_part(part: Part, x: np.ndarray, y: np.ndarray) -> Part:
    """The part moved along the floor."""
    return replace(part, x=(part.x[0] + x, part.x[1] + x), y=(part.y[0] + y, part.y[1] + y))
