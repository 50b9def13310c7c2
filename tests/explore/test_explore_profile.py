"""Laws of the safe profile."""

import jax
import jax.numpy as jnp
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from rein3d_jax.explore.profile import ExploreConfig, band_profile, safe_distances, travel
from rein3d_jax.geometry.sphere import azimuths

CONFIG = ExploreConfig()
WIDTH = 16
profiles = st.lists(st.floats(2**-7, 8, width=32), min_size=WIDTH, max_size=WIDTH).map(np.float32)

safe = jax.jit(safe_distances, static_argnames=("config",))
band = jax.jit(band_profile, static_argnames=("config",))


def by_column(profile: np.ndarray, config: ExploreConfig = CONFIG) -> np.ndarray:
    return np.asarray(safe(jnp.asarray(profile), azimuths(len(profile)), config=config))


@settings(deadline=None, max_examples=50)
@given(profiles, st.floats(-10, 10))
def test_no_point_of_a_path_is_nearer_than_the_clearance(profile: np.ndarray, direction: float) -> None:
    """Against every obstacle, anywhere within its column, over the whole path, in any direction."""
    length = float(travel(safe(jnp.asarray(profile), jnp.float32([direction]), config=CONFIG), config=CONFIG)[0])
    inside = np.linspace(-0.5, 0.5, 5)[:, None] * 2 * np.pi / WIDTH
    at = (np.asarray(azimuths(WIDTH), np.float64) + inside)[..., None]
    obstacles = profile[:, None] * np.concatenate([np.cos(at), -np.sin(at)], axis=-1)
    path = np.linspace(0, length, 50)[:, None] * np.array([np.cos(direction), -np.sin(direction)])
    gap = np.linalg.norm(obstacles[:, :, None] - path, axis=-1).min(axis=(0, 2))
    assert np.all(gap >= np.minimum(profile, CONFIG.clearance) - 1e-5)  # float32, metres up to 8


@settings(deadline=None, max_examples=50)
@given(profiles, st.integers(0, WIDTH))
def test_filter_wraps(profile: np.ndarray, columns: int) -> None:
    np.testing.assert_array_equal(by_column(np.roll(profile, columns)), np.roll(by_column(profile), columns))


@settings(deadline=None, max_examples=50)
@given(profiles)
def test_filter_is_an_erosion(profile: np.ndarray) -> None:
    """Never above the raw profile, and monotone: moving walls out never closes a direction."""
    eroded = by_column(profile)
    assert np.all(eroded <= profile)
    assert np.all(by_column(profile + np.float32(0.5)) >= eroded)


def test_filter_widens_an_obstacle_by_its_angle_and_half_a_column() -> None:
    profile = np.full(360, 10, np.float32)
    profile[180] = 1.0
    half_angle = np.degrees(np.arcsin(CONFIG.clearance / 1.0))  # columns are one degree
    assert np.sum(by_column(profile) == 1.0) == 2 * np.floor(half_angle + 0.5) + 1


def test_without_clearance_the_profile_is_its_own_safe_profile() -> None:
    profile = np.linspace(0.5, 3, WIDTH, dtype=np.float32)
    bare = ExploreConfig(camera_radius=0.0, stop_buffer=0.0)
    np.testing.assert_array_equal(by_column(profile, bare), profile)
    np.testing.assert_array_equal(by_column(np.zeros(WIDTH, np.float32), bare), 0)


def test_a_camera_against_a_wall_may_only_leave_it() -> None:
    """A wall 0.3 m ahead, nearer than the clearance of 0.4 m, and 5 m of room behind."""
    azimuth = np.asarray(azimuths(64))
    profile = np.minimum(0.3 / np.maximum(np.cos(azimuth), 1e-3), 5).astype(np.float32)
    length = np.asarray(travel(by_column(profile), config=CONFIG))
    assert np.all(length[np.abs(azimuth) < np.pi / 2] == 0)
    assert length[0] > 4  # straight back


def test_scene_scale_goes_through() -> None:
    profile = np.asarray(1 + jax.random.uniform(jax.random.key(0), (WIDTH,)))
    ten = ExploreConfig(camera_radius=2.0, stop_buffer=2.0)
    np.testing.assert_allclose(by_column(10 * profile, ten), 10 * by_column(profile), rtol=1e-6)  # float32 product


def test_band_takes_the_least_known_distance() -> None:
    distance = jnp.full((20, 4), 3.0).at[9, 1].set(2.0).at[10, 2].set(1.0).at[2, 3].set(0.5)
    valid = jnp.ones((20, 4), bool).at[10, 2].set(False)
    np.testing.assert_array_equal(band(distance, valid, config=CONFIG), [3, 2, 3, 3])  # rows 9 and 10; row 2 is no band


def test_unknown_columns_take_the_smaller_known_neighbour() -> None:
    distance = jnp.tile(jnp.float32([9, 9, 5, 9, 9, 2]), (20, 1))
    valid = jnp.tile(jnp.array([False, False, True, False, False, True]), (20, 1))
    np.testing.assert_array_equal(band(distance, valid, config=CONFIG), [2, 2, 5, 2, 2, 2])
    valid = valid.at[:, 5].set(False)
    np.testing.assert_array_equal(band(distance, valid, config=CONFIG), [5] * 6)
    np.testing.assert_array_equal(band(distance, jnp.zeros_like(valid), config=CONFIG), [0] * 6)


def test_band_of_the_smallest_picture() -> None:
    np.testing.assert_array_equal(
        band(jnp.array([[1.0, 4.0], [3.0, 2.0]]), jnp.ones((2, 2), bool), config=CONFIG), [1, 2]
    )
