"""Laws of floors: areas under cuts, inside and outside, overlap against sampling."""

import numpy as np
import pytest

from experiments.render_rooms.polygon import (
    edge_frame,
    fits_inside,
    inside,
    is_simple,
    overlap,
    polygon_area,
    rectangle,
    wall_clearance,
)

ELL = np.array([[0, 0], [4, 0], [4, 2], [2, 2], [2, 5], [0, 5]], float)


def test_the_area_of_an_ell_is_that_of_its_two_boxes():
    assert polygon_area(ELL) == pytest.approx(4 * 2 + 2 * 3)
    assert polygon_area(ELL[::-1]) == pytest.approx(-14)


def test_inward_normals_lead_inside():
    for edge in range(len(ELL)):
        start, along, inward, length = edge_frame(ELL, edge)
        assert inside(ELL, (start + along * length / 2 + 1e-6 * inward)[None])[0]
        assert not inside(ELL, (start + along * length / 2 - 1e-6 * inward)[None])[0]


def test_clearance_is_the_distance_to_the_nearest_wall():
    assert wall_clearance(ELL, np.array([[1.0, 1.0], [2.5, 1.5], [1.5, 4.0]])) == pytest.approx([1.0, 0.5, 0.5])


def test_a_bow_tie_is_not_simple():
    assert is_simple(ELL)
    assert not is_simple(ELL[[0, 2, 1, 3, 4, 5]])


def test_a_piece_that_spans_the_reentrant_corner_does_not_fit():
    assert fits_inside(ELL, rectangle(np.array([1.0, 1.0]), (1.9, 1.9), 0))
    assert not fits_inside(ELL, rectangle(np.array([2.0, 2.0]), (1.0, 1.0), np.pi / 4))
    assert not fits_inside(ELL, rectangle(np.array([3.9, 1.0]), (0.4, 0.4), 0))


def test_overlap_agrees_with_sampling():
    rng = np.random.default_rng(0)
    for _ in range(60):
        a, b = (rectangle(rng.uniform(-1, 1, 2), tuple(rng.uniform(0.3, 2, 2)), rng.uniform(0, 6)) for _ in range(2))
        points = rng.uniform(-3, 3, (20000, 2))
        sampled = bool(np.any(inside(a, points) & inside(b, points)))
        assert overlap(a, b) or not sampled  # sampling can miss a sliver, never invent one
        assert not overlap(a, b) or sampled or polygon_area(a) * polygon_area(b) < 1 or _nearly_apart(a, b)


def _nearly_apart(a, b):
    return not overlap(a + (a.mean(0) - a) * 0.05, b + (b.mean(0) - b) * 0.05)
