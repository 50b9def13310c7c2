"""The studies of what a scene needs: their lines, shares and fronts are right."""

import pytest

from benchmarks.studies.charts.compact import rows_of_front
from benchmarks.studies.parsimony import summary


def test_a_line_through_rooms_and_the_emptiest_ones_share():
    """Ten Gaussians a piece over a hundred: empty rooms have a half, a third with their seconds."""
    rows = [
        {"seed": seed, "pieces": n, "edges": 2 * n, "observed": 90 + 10 * n, "behind": 10, "cpu": {"lift": 1 + n / 5}}
        for seed in (0, 1)
        for n in (0, 5, 10)
    ]
    found = summary(rows)
    assert found["empty over full"]["gaussians"] == [0.5, 0.0]
    assert found["empty over full"]["cpu"] == [pytest.approx(1 / 3, abs=1e-3), 0.0]
    assert found["gaussians by"]["pieces"] == {"slope": 10.0, "at none": 100, "scatter": 0, "r2": 1.0}
    assert found["gaussians by"]["edges"]["slope"] == 5.0


def test_the_front_holds_what_no_smaller_file_reaches():
    sizes = {"a": (100, 20.0), "b": (200, 19.0), "c": (300, 21.0), "d": (250, 20.0)}
    rows = [{"name": name, "bytes": [size, 0.0], "psnr": [psnr, 0.0]} for name, (size, psnr) in sizes.items()]
    assert [row["name"] for row in rows_of_front([*rows, {"name": "unread", "bytes": [1, 0.0]}])] == ["a", "c"]
