"""Laws of Algorithm 2."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rein3d_jax.explore.profile import ExploreConfig, travel
from rein3d_jax.explore.viewpoints import _candidates, evaluation_viewpoints

WIDTH = 16
CONFIG = ExploreConfig(viewpoint_samples=300)


def polar(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Radius and column of positions (n, 3)."""
    azimuth = np.arctan2(-points[:, 1], points[:, 0])
    column = np.floor((azimuth / (2 * np.pi) + 0.5) * WIDTH).astype(int) % WIDTH
    return np.linalg.norm(points[:, :2], axis=-1), column


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**31), st.floats(0.1, 4))
def test_points_are_distinct_and_inside_the_usable_area(seed: int, high: float) -> None:
    safe = jax.random.uniform(jax.random.key(seed), (WIDTH,), maxval=high)
    usable = np.asarray(travel(safe, config=CONFIG))
    views = evaluation_viewpoints(jax.random.key(seed), safe, config=CONFIG)
    positions, valid = np.asarray(views.positions), np.asarray(views.valid)
    assert valid[0]
    assert np.all(positions[0] == 0)
    # 300 candidates do not run out, unless there are none.
    assert valid[1:].all() == (usable > CONFIG.min_viewpoint_travel).any()
    radius, column = polar(positions[valid])
    assert np.all(radius[1:] <= usable[column[1:]] + 1e-5)  # float32 metres
    assert np.all(usable[column[1:]] > CONFIG.min_viewpoint_travel)
    assert len(np.unique(positions[valid], axis=0)) == valid.sum()
    assert np.all(positions[:, 2] == 0)


def test_each_point_is_the_farthest_from_those_before() -> None:
    """Against a plain double loop over the same candidates."""
    safe = jnp.linspace(1.0, 4.0, WIDTH)
    key = jax.random.key(5)
    views = evaluation_viewpoints(key, safe, config=CONFIG)
    points, usable = map(np.asarray, _candidates(key, safe, CONFIG))
    points, taken = points[usable], [np.zeros(3)]
    for _ in range(CONFIG.viewpoints):
        nearest = [min(np.linalg.norm(point - other) for other in taken) for point in points]
        taken.append(points[int(np.argmax(nearest))])
    np.testing.assert_allclose(views.positions, taken, atol=1e-6)  # one jit, one not


def test_candidates_are_uniform_in_area_within_a_sector() -> None:
    """Half of a sector's area lies within R / sqrt(2): so do half of the samples."""
    config = replace(CONFIG, viewpoint_samples=20000)
    points, _ = _candidates(jax.random.key(0), jnp.full(WIDTH, 2.4), config)
    radius, column = polar(np.asarray(points))
    assert np.mean(radius < 2 / np.sqrt(2)) == pytest.approx(0.5, abs=0.015)  # four standard errors of 20000
    np.testing.assert_allclose(np.bincount(column, minlength=WIDTH) / 20000, 1 / WIDTH, atol=0.007)  # four as well


@pytest.mark.parametrize("level", [0.0, 0.4, 0.49])
def test_without_room_only_the_origin_counts(level: float) -> None:
    views = evaluation_viewpoints(jax.random.key(0), jnp.full(WIDTH, level), config=CONFIG)
    np.testing.assert_array_equal(views.valid, [True, False, False, False, False])
    np.testing.assert_array_equal(views.positions, 0)
    assert np.all(np.isfinite(views.world_from_camera))


def test_candidates_that_run_out_are_not_repeated() -> None:
    views = evaluation_viewpoints(jax.random.key(0), jnp.full(WIDTH, 3.0), config=replace(CONFIG, viewpoint_samples=2))
    np.testing.assert_array_equal(views.valid, [True, True, True, False, False])


def test_four_level_views_turn_left() -> None:
    views = evaluation_viewpoints(jax.random.key(1), jnp.full(WIDTH, 3.0), config=CONFIG)
    poses = np.asarray(views.world_from_camera)
    assert poses.shape == (5, 4, 4, 4)
    np.testing.assert_array_equal(poses[..., :3, 3], np.broadcast_to(views.positions[:, None], (5, 4, 3)))
    forward = [[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]]
    np.testing.assert_allclose(poses[..., :3, 2], np.broadcast_to(forward, (5, 4, 3)), atol=1e-6)  # float32 sines


def test_same_key_same_points() -> None:
    safe = jnp.linspace(1.0, 4.0, WIDTH)
    one, two = (evaluation_viewpoints(jax.random.key(k), safe, config=CONFIG).positions for k in (3, 4))
    np.testing.assert_array_equal(one, evaluation_viewpoints(jax.random.key(3), safe, config=CONFIG).positions)
    assert np.any(one != two)
