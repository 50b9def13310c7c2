"""Lamps, plants, pictures, rugs and what else dresses a room."""

from rein3d_jax.rooms.furniture.bounds import ACROSS, DEEP, D, H, M, O, W, around, inset, intervals
from rein3d_jax.rooms.furniture.template import Part, Piece, ball, box, cylinder


def _picture() -> tuple[Part, ...]:
    edge = 0.025
    return (
        box(0, ACROSS, (-D / 2 + 0.003 * M, D / 2), (O, H)),
        box(1, inset(ACROSS, edge), (-D / 2, O), inset((O, H), edge), casts=False),
    )


def _foliage(clumps: list[tuple[float, float, float, float]], flat: float, chance: float) -> list[Part]:
    """Flattened balls round the stem: (x, y, z, radius) in shares of the piece's size."""
    return [
        ball(1, around(x * W, r * W), around(y * D, r * D), around(z * H, flat * r * H), chance)
        for x, y, z, r in clumps
    ]


def _plant() -> tuple[Part, ...]:
    leaves = [
        (0, 0, 0.8, 0.5), (0.2, 0.1, 0.6, 0.3), (-0.2, 0.15, 0.65, 0.3), (0.05, -0.22, 0.55, 0.28),
        (-0.15, -0.15, 0.9, 0.3),
    ]  # fmt: skip
    return (
        cylinder(0, around(O, 0.28 * W), around(O, 0.28 * D), (O, 0.3 * H)),
        cylinder(2, around(O, 0.02), around(O, 0.02), (0.3 * H, 0.7 * H)),
        *_foliage(leaves, 0.45, 0.85),
    )


def _tall_plant() -> tuple[Part, ...]:
    crown = [
        (0.0, 0.0, 0.85, 0.3), (0.25, 0.1, 0.72, 0.22), (-0.22, 0.2, 0.76, 0.2), (0.0, -0.28, 0.7, 0.2),
        (-0.2, -0.15, 0.93, 0.2),
    ]  # fmt: skip
    return (
        cylinder(0, around(O, 0.18), around(O, 0.18), (O, 0.34 * M)),
        cylinder(2, around(O, 0.025), around(O, 0.025), (0.34 * M, 0.85 * H)),
        *_foliage(crown, 0.5, 0.9),
    )


def _floor_lamp() -> tuple[Part, ...]:
    return (
        cylinder(0, around(O, 0.14), around(O, 0.14), (O, 0.025 * M)),
        cylinder(0, around(O, 0.014), around(O, 0.014), (0.025 * M, H - 0.25 * M)),
        cylinder(1, ACROSS, DEEP, (H - 0.3 * M, H), casts=False),
    )


def _pendant() -> tuple[Part, ...]:
    return (
        cylinder(0, around(O, 0.008), around(O, 0.008), (0.24 * M, H)),
        ball(1, ACROSS, DEEP, (O, 0.28 * M), 0.6, False),
        cylinder(1, around(O, 0.35 * W), around(O, 0.35 * D), (0.03 * M, 0.25 * M), 0.6, False),
    )


def _wall_shelf() -> tuple[Part, ...]:
    return (
        box(0, ACROSS, DEEP, (O, 0.03 * M)),
        box(1, (-0.45 * W, -0.1 * W), inset(DEEP, 0.02), (0.03 * M, 0.25 * M), 0.7),
        cylinder(2, around(0.12 * W, 0.05), around(O, 0.05), (0.03 * M, 0.2 * M), 0.5),
        ball(2, around(0.32 * W, 0.07), around(O, 0.07), (0.02 * M, 0.15 * M), 0.5),
    )


HUNG_PIECES = {
    "picture": Piece("hung", (0.35, 1.3), (0.025, 0.04), (0.35, 0.9), ("support", "picture"), _picture(), (1.1, 1.45)),
    "mirror": Piece("hung", (0.4, 1.0), (0.02, 0.03), (0.6, 1.0), ("support", "mirror"), _picture(), (1.05, 1.2)),
    "wall_shelf": Piece(
        "hung", (0.6, 1.2), (0.2, 0.26), (0.3, 0.3), ("furniture", "books", "object"), _wall_shelf(), (1.2, 1.7)
    ),
    "curtain": Piece(
        "wall", (0.35, 0.7), (0.08, 0.14), (2.1, 2.25), ("linen",),
        tuple(
            box(0, inset(x, 0.006), (-D / 2 + (i % 2) * 0.03 * M, D / 2), (0.02 * M, H))
            for i, x in enumerate(intervals(6, *ACROSS))
        ),
    ),
    "radiator": Piece(
        "wall", (0.6, 1.4), (0.08, 0.12), (0.55, 0.65), ("ceramic", "metal"),
        tuple(box(0, inset(x, 0.012), DEEP, (0.12 * M, H)) for x in intervals(8, *ACROSS)),
    ),
    "plant": Piece("free", (0.35, 0.6), (0.35, 0.6), (0.6, 1.2), ("object", "leaf", "leaf"), _plant()),
    "tall_plant": Piece("free", (0.7, 1.1), (0.7, 1.1), (1.5, 2.1), ("object", "leaf", "support"), _tall_plant()),
    "floor_lamp": Piece("free", (0.3, 0.45), (0.3, 0.45), (1.4, 1.75), ("support", "lampshade"), _floor_lamp()),
    "rug": Piece(
        "flat", (1.2, 2.8), (0.9, 2.0), (0.008, 0.012), ("rug",), (box(0, ACROSS, DEEP, (O, H), casts=False),)
    ),
    "pendant": Piece("ceiling", (0.3, 0.55), (0.3, 0.55), (0.4, 0.65), ("support", "lampshade"), _pendant()),
    "ceiling_disc": Piece(
        "ceiling", (0.3, 0.6), (0.3, 0.6), (0.07, 0.12), ("support", "lampshade"),
        (cylinder(1, ACROSS, DEEP, (O, H), casts=False),),
    ),
    "spots": Piece(
        "ceiling", (0.8, 1.4), (0.1, 0.12), (0.12, 0.16), ("support", "lampshade"),
        (
            box(0, ACROSS, DEEP, (H - 0.03 * M, H)),
            *(cylinder(1, around(f * W, 0.04), around(O, 0.04), (O, H - 0.03 * M), casts=False)
              for f in (-0.4, 0.0, 0.4)),
        ),
    ),
}  # fmt: skip
