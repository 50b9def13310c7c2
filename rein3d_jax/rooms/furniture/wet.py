"""Kitchen and bathroom pieces."""

from rein3d_jax.rooms.furniture.bounds import ACROSS, DEEP, D, H, M, O, W, around, inset
from rein3d_jax.rooms.furniture.storage import BODY, doors
from rein3d_jax.rooms.furniture.template import Part, Piece, ball, box, cylinder


def _counter(columns: int) -> tuple[Part, ...]:
    top = (H - 0.04 * M, H)
    return (
        box(0, ACROSS, BODY, (0.1 * M, H - 0.04 * M)),
        box(0, inset(ACROSS, 0.02), (-D / 2 + 0.08 * M, D / 2), (O, 0.1 * M)),
        box(2, ACROSS, DEEP, top),
        box(2, ACROSS, (D / 2 - 0.015 * M, D / 2), (H, H + 0.4 * M), 0.4),
        *doors(columns, 1, 0.12 * M, H - 0.06 * M, 1, 3),
        box(3, around(-0.25 * W, 0.2), around(-0.05 * D, 0.2), (H - 0.01 * M, H + 0.004 * M), 0.7, False),
        cylinder(3, around(-0.25 * W, 0.015), around(0.38 * D, 0.015), (H, H + 0.28 * M), 0.7),
        box(3, around(-0.25 * W, 0.012), (0.1 * D, 0.38 * D), (H + 0.26 * M, H + 0.28 * M), 0.7),
        cylinder(3, around(0.28 * W, 0.11), around(-0.05 * D, 0.11), (H, H + 0.16 * M), 0.5),
        box(1, around(0.02 * W, 0.12), around(0.2 * D, 0.1), (H, H + 0.25 * M), 0.4),
        ball(1, around(0.4 * W, 0.09), around(0.1 * D, 0.09), (H - 0.01 * M, H + 0.15 * M), 0.4),
    )


def _bathtub() -> tuple[Part, ...]:
    rim = 0.07 * M
    return (
        box(0, (-W / 2, -W / 2 + rim), DEEP, (O, H)),
        box(0, (W / 2 - rim, W / 2), DEEP, (O, H)),
        box(0, ACROSS, (-D / 2, -D / 2 + rim), (O, H)),
        box(0, ACROSS, (D / 2 - rim, D / 2), (O, H)),
        box(0, ACROSS, DEEP, (O, 0.15 * M)),
        cylinder(1, around(-0.4 * W, 0.02), around(0.42 * D, 0.02), (H, H + 0.15 * M)),
        box(2, (0.1 * W, 0.35 * W), (-D / 2, -D / 2 + 0.09 * M), (0.5 * H, H + 0.015 * M), 0.4),
    )


def _shower() -> tuple[Part, ...]:
    return (
        box(0, ACROSS, DEEP, (O, 0.06 * M)),
        box(2, (W / 2 - 0.03 * M, W / 2), DEEP, (0.06 * M, H)),
        cylinder(1, around(O, 0.012), around(D / 2 - 0.05 * M, 0.012), (0.9 * M, H)),
        cylinder(1, around(O, 0.11), around(D / 2 - 0.2 * M, 0.11), (H - 0.04 * M, H)),
        box(1, around(O, 0.012), (D / 2 - 0.2 * M, D / 2 - 0.05 * M), (H - 0.02 * M, H)),
    )


def _vanity() -> tuple[Part, ...]:
    return (
        box(0, ACROSS, BODY, (0.2 * M, H - 0.03 * M)),
        box(2, ACROSS, DEEP, (H - 0.03 * M, H)),
        *doors(2, 1, 0.22 * M, H - 0.05 * M, 0, 3),
        ball(1, around(O, 0.23), around(-0.03 * D, 0.18), (H - 0.06 * M, H + 0.12 * M)),
        cylinder(3, around(O, 0.015), around(0.4 * D, 0.015), (H, H + 0.22 * M)),
        box(3, around(O, 0.012), (0.1 * D, 0.4 * D), (H + 0.2 * M, H + 0.22 * M)),
        cylinder(1, around(0.4 * W, 0.035), around(0.2 * D, 0.035), (H, H + 0.16 * M), 0.6),
        box(3, around(-0.38 * W, 0.06), around(0.1 * D, 0.06), (H, H + 0.08 * M), 0.4),
    )


def _toilet() -> tuple[Part, ...]:
    return (
        box(0, around(O, 0.09), (-D / 2 + 0.15 * M, D / 2 - 0.1 * M), (O, 0.25 * M)),
        ball(0, around(O, 0.19), (-D / 2, D / 2 - 0.12 * M), (0.1 * M, 0.44 * M)),
        cylinder(0, around(O, 0.19), (-D / 2, D / 2 - 0.12 * M), (0.38 * M, 0.43 * M)),
        box(0, around(O, 0.2), (D / 2 - 0.18 * M, D / 2), (0.36 * M, H)),
        box(1, around(O, 0.04), around(D / 2 - 0.09 * M, 0.03), (H, H + 0.01 * M)),
    )


def _tall_box() -> tuple[Part, ...]:
    return (
        box(0, ACROSS, (-D / 2 + 0.09 * M, D / 2), (O, H)),
        box(0, inset(ACROSS, 0.004), (-D / 2 + 0.04 * M, -D / 2 + 0.085 * M), (0.03 * M, 0.36 * H), casts=False),
        box(0, inset(ACROSS, 0.004), (-D / 2 + 0.04 * M, -D / 2 + 0.085 * M), (0.375 * H, H), casts=False),
        box(1, (W / 2 - 0.08 * M, W / 2 - 0.055 * M), (-D / 2, -D / 2 + 0.04 * M), (0.42 * H, 0.65 * H), casts=False),
        box(1, (W / 2 - 0.08 * M, W / 2 - 0.055 * M), (-D / 2, -D / 2 + 0.04 * M), (0.2 * H, 0.33 * H), casts=False),
    )


def _washer() -> tuple[Part, ...]:
    return (
        box(0, ACROSS, BODY, (0.02 * M, H)),
        ball(1, around(O, 0.2), around(-D / 2 + 0.03 * M, 0.03), around(0.45 * M, 0.2), casts=False),
        box(1, (0.05 * W, 0.4 * W), around(-D / 2 + 0.03 * M, 0.005), (H - 0.12 * M, H - 0.06 * M), casts=False),
        box(2, around(-0.1 * W, 0.14), around(O, 0.14), (H, H + 0.22 * M), 0.5),
    )


def _island() -> tuple[Part, ...]:
    stools = [
        part
        for f in (-0.25, 0.25)
        for part in (
            cylinder(3, around(f * W, 0.17), around(-D / 2 + 0.17 * M, 0.17), (0.62 * M, 0.67 * M)),
            cylinder(3, around(f * W, 0.025), around(-D / 2 + 0.17 * M, 0.025), (O, 0.62 * M)),
            cylinder(3, around(f * W, 0.16), around(-D / 2 + 0.17 * M, 0.16), (O, 0.02 * M)),
        )
    ]
    return (
        box(0, inset(ACROSS, 0.03), (-D / 2 + 0.4 * M, D / 2), (0.05 * M, H - 0.04 * M)),
        box(2, ACROSS, (-D / 2 + 0.2 * M, D / 2), (H - 0.04 * M, H)),
        *stools,
        ball(3, around(0.1 * W, 0.15), around(0.1 * D, 0.15), (H - 0.03 * M, H + 0.12 * M), 0.6),
    )


_KITCHEN = ("front", "front", "stone", "metal")

WET_PIECES = {
    "counter": Piece("wall", (1.8, 3.2), (0.6, 0.65), (0.86, 0.94), _KITCHEN, _counter(4)),
    "short_counter": Piece("wall", (0.9, 1.6), (0.6, 0.65), (0.86, 0.94), _KITCHEN, _counter(2)),
    "wall_cabinets": Piece(
        "hung", (1.2, 2.6), (0.3, 0.36), (0.55, 0.75), ("front", "front", "metal"),
        (box(0, ACROSS, BODY, (O, H)), *doors(4, 1, O, H)),
        (1.4, 1.5),
    ),
    "island": Piece("free", (1.2, 1.8), (1.0, 1.2), (0.86, 0.94), ("front", "front", "stone", "support"), _island()),
    "fridge": Piece("wall", (0.6, 0.9), (0.65, 0.72), (1.6, 2.0), ("ceramic", "metal"), _tall_box()),
    "bathtub": Piece("wall", (1.5, 1.8), (0.7, 0.85), (0.52, 0.62), ("ceramic", "metal", "pillow"), _bathtub()),
    "shower": Piece("wall", (0.8, 1.1), (0.8, 1.0), (1.95, 2.1), ("ceramic", "metal", "wet_wall"), _shower()),
    "vanity": Piece("wall", (0.7, 1.3), (0.45, 0.52), (0.78, 0.88), ("front", "ceramic", "stone", "metal"), _vanity()),
    "toilet": Piece("wall", (0.42, 0.42), (0.65, 0.72), (0.75, 0.85), ("ceramic", "metal"), _toilet()),
    "washer": Piece("wall", (0.6, 0.6), (0.58, 0.62), (0.84, 0.86), ("ceramic", "screen", "pillow"), _washer()),
}  # fmt: skip
