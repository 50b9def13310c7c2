"""Laws of a room: pure, closed, with room to stand, and nothing inside anything else."""

import jax
import numpy as np
import pytest

from rein3d_jax.conventions import EYE_HEIGHT
from rein3d_jax.errors import InputError
from rein3d_jax.rooms.config import PAPER_MIX, ROOM_KINDS, RoomConfig
from rein3d_jax.rooms.generate import generate_room, pack

FIRST_PIECE = 11  # object ids: 6 faces, 4 openings, structure
ATOL = 1e-3  # metres: float32 sums of metres; touching is allowed


def boxes_of(rooms, index):
    """centre, half, heading, object of the boxes used in room `index`, float64."""
    boxes = jax.tree.map(lambda x: np.asarray(x[index]), rooms.boxes)
    return [x[: boxes.count].astype(np.float64) for x in (boxes.centre, boxes.half, boxes.heading, boxes.object)]


def plan_corners(centre, half, heading):
    """(n, 4, 2)."""
    c, s = heading[:, 0, None], heading[:, 1, None]
    x, y = (half[:, i, None] * np.array(signs) for i, signs in ((0, (1, 1, -1, -1)), (1, (1, -1, -1, 1))))
    return centre[:, None, :2] + np.stack([c * x - s * y, s * x + c * y], -1)


@pytest.mark.slow
def test_same_key_same_bytes_and_vmap_is_a_loop(many_rooms):
    closed = RoomConfig(open_windows=0.0)
    make, keys = jax.jit(lambda key: generate_room(key, closed)), jax.random.split(jax.random.key(7), 64)
    once, again = make(keys[3]), make(keys[3])
    assert all(
        jax.tree.leaves(jax.tree.map(lambda a, b: a.tobytes() == b.tobytes(), *map(jax.device_get, (once, again))))
    )
    other = jax.tree.map(lambda x: x[3], many_rooms)
    # Two compilations of the same formulas: a rounding or two of metres and colours.
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=2e-5, atol=2e-5), once, other)


def test_sizes_are_those_of_rooms(many_rooms):
    size = np.asarray(many_rooms.high - many_rooms.low)
    assert size[:, :2].min() >= 2.4 and size[:, :2].max() <= 8
    assert size[:, 2].min() >= 2.3 and size[:, 2].max() <= 3.2
    np.testing.assert_allclose(many_rooms.low[:, 2], -EYE_HEIGHT)
    assert not np.asarray(many_rooms.overflow).any()


def test_kinds_come_in_the_paper_s_mix(many_rooms):
    share = np.bincount(np.asarray(many_rooms.kind), minlength=len(ROOM_KINDS)) / len(many_rooms.kind)
    expected = np.array(PAPER_MIX) / sum(PAPER_MIX)
    assert np.all(np.abs(share - expected) < 4 * np.sqrt(expected * (1 - expected) / len(many_rooms.kind)))  # 4 sigma


def test_boxes_stay_inside_the_shell(many_rooms):
    for index in range(len(many_rooms.kind)):
        centre, half, heading, _ = boxes_of(many_rooms, index)
        low, high = (np.asarray(x[index], np.float64) for x in (many_rooms.low, many_rooms.high))
        corners = plan_corners(centre, half, heading)
        assert np.all(corners >= low[:2] - 1e-4) and np.all(corners <= high[:2] + 1e-4)  # float32 metres
        assert np.all(centre[:, 2] - half[:, 2] >= low[2] - 1e-4)
        assert np.all(centre[:, 2] + half[:, 2] <= high[2] + 1e-4)


def test_the_camera_stands_clear(many_rooms):
    """What rises between the floor and 1.9 m keeps RoomConfig.clearance from the vertical through the origin."""
    for index in range(len(many_rooms.kind)):
        for name in ("boxes", "cylinders", "ellipsoids"):
            solids = jax.tree.map(lambda x, index=index: np.asarray(x[index]), getattr(many_rooms, name))
            n = int(solids.count)
            centre, half, heading = solids.centre[:n], solids.half[:n], solids.heading[:n]
            c, s = heading[:, 0], heading[:, 1]
            own = np.abs(np.stack([c * centre[:, 0] + s * centre[:, 1], c * centre[:, 1] - s * centre[:, 0]], -1))
            away = np.linalg.norm(np.maximum(own - half[:, :2], 0), axis=-1)
            in_the_way = (centre[:, 2] + half[:, 2] > -1.57) & (centre[:, 2] - half[:, 2] < 0.3)
            assert np.all(away[in_the_way] > RoomConfig().clearance - ATOL), (index, name)


def test_no_box_has_its_centre_in_another_object(many_rooms):
    for index in range(len(many_rooms.kind)):
        centre, half, heading, name = boxes_of(many_rooms, index)
        between = centre[:, None] - centre[None]
        c, s = heading[:, 0], heading[:, 1]
        own = np.stack(
            [c * between[..., 0] + s * between[..., 1], c * between[..., 1] - s * between[..., 0], between[..., 2]], -1
        )
        within = np.all(np.abs(own) < half - ATOL, axis=-1)
        assert not (within & (name[:, None] != name)).any(), index


def test_rooms_are_furnished(many_rooms):
    """Every room holds things, and no two are the same."""
    pieces = [len(set(boxes_of(many_rooms, i)[3][boxes_of(many_rooms, i)[3] >= FIRST_PIECE])) for i in range(64)]
    assert min(pieces) >= 2 and np.mean(pieces) >= 5
    assert len({x.tobytes() for x in np.asarray(many_rooms.low)}) == len(pieces)


def test_a_full_buffer_is_confessed(many_rooms):
    """And what casts no shadow is given up first."""
    boxes = jax.tree.map(lambda x: x[0], many_rooms.boxes)
    chosen, casts = np.arange(144) < 20, np.arange(144) % 2 == 0
    packed, lost = pack(boxes, chosen, casts, 16)
    assert (packed.count, packed.casters, lost) == (16, 10, 4)
    np.testing.assert_array_equal(packed.centre[:10], boxes.centre[:20:2])
    np.testing.assert_array_equal(packed.centre[10:], boxes.centre[1:12:2])


@pytest.mark.parametrize("wrong", [{"mix": (1.0,)}, {"clearance": 2.0}, {"furnished": 1.5}, {"boxes": 12}])
def test_a_config_says_what_is_wrong(wrong):
    with pytest.raises(InputError, match=f"^{next(iter(wrong))} must be "):
        RoomConfig(**wrong)
