"""What is known stays, what is not gets a finite distance."""

import jax.numpy as jnp
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from rein3d_jax.depth.complete import CompleteConfig, complete_distance
from rein3d_jax.depth.room_shell import shell_distance
from rein3d_jax.geometry.shell import RoomShell

H, W = 32, 64
ROUNDING = 1e-5  # float32: five levels of averages, and 1 / (1 / x)
CONFIG = CompleteConfig(speck=2, far=10.0)
ROOM = RoomShell(jnp.float32(0.3), jnp.array([2.0, 3.0, 2.5, 1.5]), jnp.float32(1.6), jnp.float32(1.1))


def all_but(rows, columns):
    valid = np.ones((H, W), bool)
    valid[np.ix_(rows, np.asarray(columns) % W)] = False
    return valid


def test_all_known_is_the_identity():
    distance = shell_distance(ROOM, H, W)
    completed = complete_distance(distance, jnp.ones((H, W), bool), config=CONFIG)
    np.testing.assert_array_equal(completed, distance)


@given(st.integers(0, 2**31), st.floats(0.0, 1.0))
@settings(max_examples=20, deadline=None)
def test_known_pixels_stay_and_the_rest_is_finite(seed, share):
    rng = np.random.default_rng(seed)
    distance = rng.uniform(0.3, 20.0, (H, W)).astype(np.float32)
    valid = rng.random((H, W)) < share
    unknown = rng.choice(np.array([np.nan, np.inf, -1.0, 0.0], np.float32), (H, W))
    completed = np.asarray(complete_distance(np.where(valid, distance, unknown), valid, config=CONFIG))
    np.testing.assert_array_equal(completed[valid], distance[valid])
    assert np.isfinite(completed).all()
    if valid.any():  # averages of averages never leave the range, and the rest is far
        assert completed.min() >= distance[valid].min() * (1 - ROUNDING)
        assert completed.max() <= max(distance[valid].max(), CONFIG.far * np.median(distance[valid])) * (1 + ROUNDING)
    else:
        assert (completed == 0).all()


@given(st.integers(0, H - 1), st.integers(0, W - 1), st.floats(0.125, 100.0, width=32))
@settings(max_examples=20, deadline=None)
def test_one_known_pixel_tells_the_scale_of_all(row, column, metres):
    valid = jnp.zeros((H, W), bool).at[row, column].set(True)
    completed = complete_distance(jnp.where(valid, jnp.float32(metres), jnp.nan), valid, config=CompleteConfig(far=1.0))
    np.testing.assert_allclose(completed, metres, rtol=ROUNDING)


def test_a_panorama_turned_by_the_coarsest_cell_is_completed_turned():
    # 32 of 64 columns: the cells of the coarsest level (1 x 2), and so those of every level, fall onto each other.
    distance, valid = shell_distance(ROOM, H, W), all_but(range(12, 18), range(-4, 3))
    turned = complete_distance(jnp.roll(distance, 32, axis=1), jnp.roll(valid, 32, axis=1), config=CONFIG)
    expected = jnp.roll(complete_distance(distance, valid, config=CONFIG), 32, axis=1)
    np.testing.assert_allclose(turned, expected, rtol=ROUNDING)


def test_a_speck_is_filled_from_its_wall_and_a_window_is_far_on_the_seam_too():
    distance = shell_distance(ROOM, H, W)
    for column in (29, 0):
        speck, window = all_but([14, 15], [column - 1, column]), all_but(range(10, 20), range(column - 6, column + 6))
        filled = complete_distance(jnp.where(speck, distance, 0.0), speck, config=CONFIG)
        # The ray turns 11 degrees across the speck and its rim; push-pull averages what it finds there.
        np.testing.assert_allclose(filled[~speck], distance[~speck], rtol=0.1)
        opened = complete_distance(jnp.where(window, distance, 0.0), window, config=CONFIG)
        far = CONFIG.far * jnp.median(distance[window])
        np.testing.assert_allclose(opened[14:16, column], far, rtol=ROUNDING)
