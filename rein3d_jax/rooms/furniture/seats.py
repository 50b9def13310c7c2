"""Tables, chairs, sofas and beds."""

from rein3d_jax.rooms.furniture.bounds import ACROSS, DEEP, D, H, M, O, W, around, inset, intervals
from rein3d_jax.rooms.furniture.template import Part, Piece, ball, box, cylinder, legs, move_part


def _chair(back: int, width: float = 0.42, texture: int = 1) -> tuple[Part, ...]:
    """A chair at the origin, in metres; `back` = 1 when it faces -y."""
    half = width / 2
    side = (half - 0.04) * M if back > 0 else -half * M
    across = around(O, half)
    return (
        box(texture, across, across, (0.43 * M, 0.47 * M)),
        box(texture, across, (side, side + 0.04 * M), (0.5 * M, 0.9 * M)),
        *legs(texture + 1, across, across, 0.43 * M, 0.04),
    )


def _dining_chairs() -> tuple[Part, ...]:
    back, front = _chair(1), _chair(-1)
    places = [(-W / 4 + O, D / 2 - 0.25 * M, back), (W / 4 + O, D / 2 - 0.25 * M, back)]
    places += [(-W / 4 + O, -D / 2 + 0.25 * M, front), (W / 4 + O, -D / 2 + 0.25 * M, front)]
    return tuple(move_part(part, x, y) for x, y, chair in places for part in chair)


def _sofa_parts(seats: int) -> tuple[Part, ...]:
    arm, back = 0.18 * M, 0.22 * M
    inner = (-W / 2 + arm, W / 2 - arm)
    seat, lean = (-D / 2, D / 2 - back), (D / 2 - back, D / 2)
    cushions = [box(0, inset(x, 0.008), seat, (0.52 * H, 0.64 * H)) for x in intervals(seats, *inner)]
    rests = [
        box(0, inset(x, 0.008), (lean[0] - 0.12 * M, lean[0]), (0.65 * H, 1.03 * H)) for x in intervals(seats, *inner)
    ]
    return (
        box(0, ACROSS, DEEP, (0.08 * M, 0.5 * H)),
        box(0, inner, lean, (0.5 * H, H)),
        box(0, (-W / 2, -W / 2 + arm), DEEP, (0.5 * H, 0.74 * H)),
        box(0, (W / 2 - arm, W / 2), DEEP, (0.5 * H, 0.74 * H)),
        *cushions,
        *rests,
        *legs(2, ACROSS, DEEP, 0.08 * M, 0.06),
        ball(
            1, around(inner[0] + 0.22 * M, 0.2), around(D / 2 - 0.42 * M, 0.09), around(0.64 * H + 0.17 * M, 0.18), 0.6
        ),
        ball(
            1, around(inner[1] - 0.22 * M, 0.2), around(D / 2 - 0.42 * M, 0.09), around(0.64 * H + 0.17 * M, 0.18), 0.5
        ),
    )


def _corner_sofa() -> tuple[Part, ...]:
    chaise = (W / 2 - 0.85 * M, W / 2)
    back = (D / 2 - 0.85 * M, D / 2)
    return (
        box(0, ACROSS, back, (0.06 * M, 0.48 * H)),
        box(0, chaise, (-D / 2, D / 2 - 0.85 * M), (0.06 * M, 0.48 * H)),
        box(0, inset(chaise, 0.01), (-D / 2, D / 2 - 0.22 * M), (0.5 * H, 0.62 * H)),
        *(
            box(0, inset(x, 0.008), (back[0], D / 2 - 0.22 * M), (0.5 * H, 0.62 * H))
            for x in intervals(2, -W / 2 + 0.2 * M, W / 2 - 0.85 * M)
        ),
        box(0, ACROSS, (D / 2 - 0.2 * M, D / 2), (0.48 * H, H)),
        box(0, (-W / 2, -W / 2 + 0.2 * M), back, (0.48 * H, 0.75 * H)),
        *(
            ball(1, around(-W / 2 + f * W, 0.21), around(D / 2 - 0.3 * M, 0.1), around(0.62 * H + 0.18 * M, 0.18), 0.6)
            for f in (0.2, 0.5, 0.8)
        ),
    )


def _bed(pillows: int) -> tuple[Part, ...]:
    head = D / 2 - 0.06 * M
    wide = inset(ACROSS, 0.03)
    rows = intervals(pillows, *inset(wide, 0.05))
    return (
        box(0, ACROSS, (-D / 2, head), (0.1 * M, 0.3 * M)),
        *legs(0, ACROSS, DEEP, 0.1 * M, 0.08),
        box(1, wide, (-D / 2 + 0.03 * M, head), (0.3 * M, 0.48 * M)),
        box(2, ACROSS, (-D / 2, head - 0.65 * M), (0.26 * M, 0.53 * M), 0.85),
        box(3, ACROSS, (-D / 2 + 0.1 * M, -D / 2 + 0.6 * M), (0.25 * M, 0.55 * M), 0.35),
        box(0, ACROSS, (head, D / 2), (0.1 * M, H)),
        *(ball(1, inset(x, 0.02), (head - 0.5 * M, head - 0.05 * M), (0.45 * M, 0.65 * M)) for x in rows),
        *(ball(3, inset(x, 0.12), (head - 0.62 * M, head - 0.35 * M), (0.48 * M, 0.78 * M), 0.4) for x in rows),
    )


def _table_top() -> tuple[Part, ...]:
    """Things that stand on a table."""
    return (
        cylinder(3, around(0.2 * W, 0.06), around(0.1 * D, 0.06), (H, H + 0.22 * M), 0.35),
        ball(3, around(-0.15 * W, 0.13), around(0.05 * D, 0.13), (H - 0.05 * M, H + 0.1 * M), 0.35),
        box(3, around(0.05 * W, 0.12), around(-0.15 * D, 0.09), (H, H + 0.03 * M), 0.35),
    )


def _table() -> tuple[Part, ...]:
    apron = (H - 0.1 * M, H - 0.04 * M)
    return (
        box(0, ACROSS, DEEP, (H - 0.04 * M, H)),
        *legs(1, inset(ACROSS, 0.03), inset(DEEP, 0.03), H - 0.04 * M, 0.06),
        box(0, inset(ACROSS, 0.05), inset(DEEP, 0.05), apron, 0.4),
        box(0, inset(ACROSS, 0.05), inset(DEEP, 0.05), (0.25 * H, 0.25 * H + 0.02 * M), 0.3),
        *_table_top(),
    )


def _round_table() -> tuple[Part, ...]:
    return (
        cylinder(0, ACROSS, DEEP, (H - 0.035 * M, H)),
        cylinder(1, around(O, 0.045), around(O, 0.045), (O, H - 0.035 * M)),
        cylinder(1, around(O, W / 3.5), around(O, D / 3.5), (O, 0.03 * M)),
        *_table_top(),
    )


_DINING_TOP = (around(O, W / 2 - 0.05 * M), around(O, D / 2 - 0.35 * M))
_ROUND_TOP = (around(O, W / 2 - 0.4 * M), around(O, D / 2 - 0.4 * M))

SEAT_PIECES = {
    "dining": Piece(
        "free", (1.3, 2.1), (1.5, 1.75), (0.72, 0.77), ("furniture", "front", "support", "object"),
        (
            box(0, *_DINING_TOP, (H - 0.04 * M, H)), *legs(2, *_DINING_TOP, H - 0.04 * M, 0.06), *_dining_chairs(),
            *_table_top()[:2],
        ),
    ),
    "round_dining": Piece(
        "free", (1.5, 1.9), (1.5, 1.9), (0.72, 0.77), ("furniture", "front", "support", "object"),
        (
            cylinder(0, *_ROUND_TOP, (H - 0.04 * M, H)),
            cylinder(2, around(O, 0.06), around(O, 0.06), (O, H - 0.04 * M)),
            cylinder(2, around(O, 0.28), around(O, 0.28), (O, 0.04 * M)), *_table_top()[:2],
            *(move_part(p, O, D / 2 - 0.25 * M) for p in _chair(1)),
            *(move_part(p, O, -D / 2 + 0.25 * M) for p in _chair(-1)),
        ),
    ),
    "coffee_table": Piece(
        "free", (0.7, 1.3), (0.5, 0.8), (0.32, 0.5), ("furniture", "support", "furniture", "object"), _table()
    ),
    "round_table": Piece(
        "free", (0.6, 1.0), (0.6, 1.0), (0.4, 0.7), ("furniture", "support", "furniture", "object"), _round_table()
    ),
    "side_table": Piece(
        "wall", (0.4, 1.2), (0.35, 0.5), (0.5, 0.8), ("furniture", "support", "furniture", "object"), _table()
    ),
    "sofa": Piece("wall", (1.6, 2.4), (0.85, 1.0), (0.75, 0.95), ("soft", "pillow", "support"), _sofa_parts(3)),
    "corner_sofa": Piece("wall", (2.2, 3.0), (1.5, 1.9), (0.7, 0.9), ("soft", "pillow"), _corner_sofa()),
    "armchair": Piece("free", (0.75, 0.95), (0.75, 0.95), (0.75, 1.0), ("soft", "pillow", "support"), _sofa_parts(1)),
    "chair": Piece("free", (0.42, 0.42), (0.42, 0.42), (0.9, 0.9), ("object", "front", "support"), _chair(1)),
    "pouf": Piece(
        "free", (0.4, 0.7), (0.4, 0.7), (0.35, 0.5), ("soft", "pillow"),
        (cylinder(0, ACROSS, DEEP, (0.02 * M, 0.8 * H)), ball(0, ACROSS, DEEP, (0.55 * H, 1.05 * H))),
    ),
    "bed": Piece("wall", (1.4, 1.9), (2.0, 2.2), (0.8, 1.3), ("furniture", "linen", "soft", "pillow"), _bed(2)),
    "single_bed": Piece("wall", (0.9, 1.1), (1.95, 2.1), (0.6, 1.1), ("furniture", "linen", "soft", "pillow"), _bed(1)),
}  # fmt: skip
