"""Cabinets, wardrobes, shelves and desks."""

import numpy as np

from rein3d_jax.rooms.furniture.bounds import ACROSS, DEEP, D, H, M, O, W, around, inset, intervals
from rein3d_jax.rooms.furniture.template import Part, Piece, ball, box, cylinder, legs

BODY = (-D / 2 + 0.03 * M, D / 2)  # doors and drawers stand a little before it, their handles end at the piece's front
_FRONT = (-D / 2 + 0.026 * M, -D / 2 + 0.05 * M)
_HANDLE = (-D / 2, -D / 2 + 0.026 * M)


def _on_top(texture: int) -> tuple[Part, ...]:
    return (
        cylinder(texture, around(-0.3 * W, 0.07), around(O, 0.07), (H, H + 0.25 * M), 0.4),
        ball(texture, around(0.1 * W, 0.1), around(O, 0.1), (H - 0.02 * M, H + 0.18 * M), 0.3),
        box(texture, around(0.28 * W, 0.11), around(O, 0.08), (H, H + 0.14 * M), 0.4),
    )


def doors(
    columns: int, rows: int, low: np.ndarray, high: np.ndarray, front: int = 1, handle: int = 2
) -> tuple[Part, ...]:
    """Doors or drawers on the front, each with a bar for a handle."""
    parts = []
    for x in intervals(columns, *inset(ACROSS, 0.02)):
        for z in intervals(rows, low, high):
            parts.append(box(front, inset(x, 0.006), _FRONT, inset(z, 0.006), casts=False))
            middle, top = (x[0] + x[1]) / 2, z[1] - 0.06 * M
            if rows > 1:
                parts.append(box(handle, around(middle, 0.06), _HANDLE, (top, top + 0.015 * M), 0.7, False))
            else:
                parts.append(
                    box(
                        handle, (x[1] - 0.05 * M, x[1] - 0.035 * M), _HANDLE, around((low + high) / 2, 0.08), 0.7, False
                    )
                )
    return tuple(parts)


def _case(boards: int) -> tuple[Part, ...]:
    """Sides, back and boards of a shelf."""
    thick = 0.025 * M
    return (
        box(0, (-W / 2, -W / 2 + thick), DEEP, (O, H)),
        box(0, (W / 2 - thick, W / 2), DEEP, (O, H)),
        box(0, ACROSS, (D / 2 - 0.01 * M, D / 2), (O, H), 0.7),
        *(box(0, ACROSS, DEEP, (z[0], z[0] + thick)) for z in intervals(boards, 0.05 * M, H - 0.025 * M)),
        box(0, ACROSS, DEEP, (H - thick, H)),
    )


def _filled_shelf() -> tuple[Part, ...]:
    fill = []
    for i, z in enumerate(intervals(4, 0.05 * M, H - 0.025 * M)):
        on, high = z[0] + 0.025 * M, z[0] + 0.025 * M + 0.72 * (z[1] - z[0])
        cut = (0.1, 0.3, -0.05, 0.2)[i] * W
        deep = (-D / 2 + 0.03 * M, D / 2 - 0.02 * M)
        fill.append(box(1, (-W / 2 + 0.03 * M, cut), deep, (on, high), 0.75))
        fill.append(box(2, (cut + 0.06 * W, W / 2 - 0.04 * M), deep, (on, on + 0.5 * (z[1] - z[0])), 0.4))
        fill.append(ball(3, around(0.5 * cut + 0.25 * W, 0.07), around(O, 0.07), (on - 0.01 * M, on + 0.15 * M), 0.3))
    return tuple(fill)


def _television() -> tuple[Part, ...]:
    screen = around(O, 0.38 * W)
    return (
        box(2, screen, around(0.1 * D, 0.02), (H + 0.06 * M, H + 0.06 * M + 0.43 * W), 0.85),
        box(2, around(O, 0.15), around(0.1 * D, 0.08), (H, H + 0.06 * M), 0.85),
    )


def _desk() -> tuple[Part, ...]:
    return (
        box(0, ACROSS, DEEP, (H - 0.03 * M, H)),
        *legs(1, ACROSS, DEEP, H - 0.03 * M, 0.05),
        box(0, (W / 2 - 0.42 * M, W / 2 - 0.05 * M), inset(DEEP, 0.05), (0.1 * M, H - 0.03 * M), 0.6),
        box(2, around(-0.1 * W, 0.28), around(0.2 * D, 0.015), (H + 0.1 * M, H + 0.45 * M), 0.6),
        box(2, around(-0.1 * W, 0.1), around(0.2 * D, 0.07), (H, H + 0.1 * M), 0.6),
        box(3, around(0.25 * W, 0.11), around(O, 0.15), (H, H + 0.05 * M), 0.6),
        cylinder(3, around(-0.42 * W, 0.04), around(0.1 * D, 0.04), (H, H + 0.11 * M), 0.6),
        box(3, around(-0.1 * W, 0.2), around(-0.2 * D, 0.07), (H, H + 0.02 * M), 0.5),
    )


_CABINET = (box(0, ACROSS, BODY, (0.06 * M, H)), *legs(2, ACROSS, DEEP, 0.06 * M, 0.05))
_TEXTURES = ("furniture", "front", "support", "object")

STORAGE_PIECES = {
    "cabinet": Piece(
        "wall", (0.8, 1.6), (0.38, 0.5), (0.7, 1.1), _TEXTURES,
        (*_CABINET, *doors(2, 3, 0.08 * M, H - 0.03 * M), *_on_top(3)),
    ),
    "tv_unit": Piece(
        "wall", (1.2, 2.0), (0.36, 0.45), (0.35, 0.55), ("furniture", "front", "screen", "object"),
        (
            *_CABINET, *doors(3, 1, 0.08 * M, H - 0.03 * M), *_television(),
            cylinder(3, around(0.44 * W, 0.05), around(O, 0.05), (H, H + 0.2 * M), 0.5),
        ),
    ),
    "nightstand": Piece(
        "wall", (0.4, 0.55), (0.36, 0.42), (0.42, 0.6), ("furniture", "front", "support", "lampshade"),
        (
            *_CABINET, *doors(1, 2, 0.08 * M, H - 0.03 * M),
            cylinder(2, around(O, 0.02), around(O, 0.02), (H, H + 0.25 * M), 0.7),
            cylinder(3, around(O, 0.11), around(O, 0.11), (H + 0.22 * M, H + 0.4 * M), 0.7, False),
        ),
    ),
    "wardrobe": Piece(
        "wall", (1.0, 2.2), (0.55, 0.65), (1.9, 2.25), _TEXTURES,
        (box(0, ACROSS, BODY, (O, H)), *doors(3, 1, 0.06 * M, H - 0.03 * M)),
    ),
    "shelf": Piece(
        "wall", (0.7, 1.4), (0.26, 0.36), (1.4, 2.1), ("furniture", "books", "object", "object"),
        (*_case(4), *_filled_shelf()),
    ),
    "open_shelf": Piece(
        "wall", (0.6, 1.6), (0.26, 0.4), (0.75, 1.3), ("furniture", "books", "object", "object"),
        (
            *_case(2), *_on_top(3), box(1, (-0.44 * W, -0.05 * W), inset(DEEP, 0.02), (0.075 * M, 0.4 * H), 0.8),
            box(1, (0.05 * W, 0.42 * W), inset(DEEP, 0.02), (0.5 * H + 0.05 * M, 0.85 * H), 0.7),
            box(2, (0.1 * W, 0.4 * W), inset(DEEP, 0.04), (0.075 * M, 0.35 * H), 0.6),
        ),
    ),
    "desk": Piece(
        "wall", (1.0, 1.6), (0.55, 0.75), (0.72, 0.76), ("furniture", "support", "screen", "object"), _desk()
    ),
}  # fmt: skip
