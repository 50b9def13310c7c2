"""Furniture as tables: a piece is a list of parts whose bounds are linear in the piece's width, depth and height.

A piece stands centred on the origin of its own axes: x along the wall from -W/2 to W/2, y from -D/2 (its front) to D/2
(its back, at the wall), z from 0 to H. Bounds are written with the unit vectors W, D, H and M, one metre:
`(-W / 2 + 0.05 * M, W / 2)`."""

from dataclasses import dataclass, replace

import numpy as np

W, D, H, M = np.eye(4)
BOX, CYLINDER, ELLIPSOID = 0, 1, 2
MAX_PARTS = 32  # of a piece
MAX_TEXTURES = 4  # of a piece
Bounds = tuple[np.ndarray, np.ndarray]
Range = tuple[float, float]

ACROSS: Bounds = (-W / 2, W / 2)
DEEP: Bounds = (-D / 2, D / 2)


@dataclass(frozen=True)
class Part:
    """A box, or a cylinder or ellipsoid inscribed in it."""

    shape: int
    texture: int  # index into the piece's textures
    x: Bounds
    y: Bounds
    z: Bounds
    chance: float = 1.0  # that it is there
    casts: bool = True  # a shadow; not what glows or lies close on another part


@dataclass(frozen=True)
class Piece:
    """A kind of furniture. Where it goes:
    wall     its back at a wall, on the floor       free     anywhere on the floor, at any yaw
    hung     its back at a wall, at `lift`          flat     anywhere on the floor, under everything
    ceiling  anywhere under the ceiling"""

    place: str
    width: Range  # metres
    depth: Range
    height: Range
    textures: tuple[str, ...]  # names in materials.GROUPS
    parts: tuple[Part, ...]
    lift: Range = (0.0, 0.0)  # metres from the floor to its lower end; from the ceiling to its upper end


def box(texture: int, x: Bounds, y: Bounds, z: Bounds, chance: float = 1.0, casts: bool = True) -> Part:
    """A box between the bounds."""
    return Part(BOX, texture, x, y, z, chance, casts)


def cylinder(texture: int, x: Bounds, y: Bounds, z: Bounds, chance: float = 1.0, casts: bool = True) -> Part:
    """An upright elliptic cylinder in the bounds."""
    return Part(CYLINDER, texture, x, y, z, chance, casts)


def ball(texture: int, x: Bounds, y: Bounds, z: Bounds, chance: float = 1.0, casts: bool = True) -> Part:
    """An ellipsoid in the bounds."""
    return Part(ELLIPSOID, texture, x, y, z, chance, casts)


def around(centre: np.ndarray, half: float | np.ndarray) -> Bounds:
    """Bounds centre - half, centre + half; a number is metres."""
    half = half * M if np.isscalar(half) else half
    return centre - half, centre + half


def legs(
    texture: int, x: Bounds, y: Bounds, top: np.ndarray, thick: float = 0.05, chance: float = 1.0
) -> tuple[Part, ...]:
    """Four square legs inside the corners of x and y, from the floor to `top`."""
    t = thick * M
    sides = [[(b[0], b[0] + t), (b[1] - t, b[1])] for b in (x, y)]
    return tuple(box(texture, i, j, (0 * M, top), chance) for i in sides[0] for j in sides[1])


def intervals(count: int, low: np.ndarray, high: np.ndarray) -> list[Bounds]:
    """Bounds of `count` equal intervals from `low` to `high`."""
    return [(low + (high - low) * (i / count), low + (high - low) * ((i + 1) / count)) for i in range(count)]


def inset(bounds: Bounds, by: float) -> Bounds:
    """Bounds drawn in by metres at both ends."""
    return bounds[0] + by * M, bounds[1] - by * M


def move_part(part: Part, x: np.ndarray, y: np.ndarray) -> Part:
    """The part moved along the floor."""
    return replace(part, x=(part.x[0] + x, part.x[1] + x), y=(part.y[0] + y, part.y[1] + y))
