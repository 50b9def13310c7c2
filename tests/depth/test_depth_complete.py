"""What is known stays, what is not gets a finite distance."""

import jax.numpy as jnp
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from rein3d_jax.depth.complete import CompleteConfig, complete_distance
from rein3d_jax.depth.room_shell import shell_distance
from rein3d_jax.geometry.shell import RoomShell
from rein3d_jax.scene import Panorama

H, W = 32, 64
ROUNDING = 1e-5  # float32: five levels of averages, and 1 / (1 / x)
CONFIG = CompleteConfig(speck=2, far=10.0)
ROOM = RoomShell(jnp.float32(0.3), jnp.array([2.0, 3.0, 2.5, 1.5]), jnp.float32(1.6), jnp.float32(1.1))


WALL, GLASS, SHADOW = 0.4, 0.9, 0.02  # sRGB


def all_but(rows, columns):
    valid = np.ones((H, W), bool)
    valid[np.ix_(rows, np.asarray(columns) % W)] = False
    return valid


def completed_of(distance, valid, unknown=WALL, config=CONFIG):
    """A room of one colour, with another where nothing is known."""
    rgb = jnp.where(valid[..., None], WALL, unknown) * jnp.ones(3)
    return complete_distance(Panorama(rgb, jnp.asarray(distance, jnp.float32), jnp.asarray(valid)), config=config)


def test_all_known_is_the_identity():
    distance = shell_distance(ROOM, H, W)
    completed = completed_of(distance, np.ones((H, W), bool))
    np.testing.assert_array_equal(completed, distance)


@given(st.integers(0, 2**31), st.floats(0.0, 1.0))
@settings(max_examples=20, deadline=None)
def test_known_pixels_stay_and_the_rest_is_finite(seed, share):
    rng = np.random.default_rng(seed)
    distance = rng.uniform(0.3, 20.0, (H, W)).astype(np.float32)
    valid = rng.random((H, W)) < share
    unknown = rng.choice(np.array([np.nan, np.inf, -1.0, 0.0], np.float32), (H, W))
    completed = np.asarray(completed_of(np.where(valid, distance, unknown), valid, GLASS))
    np.testing.assert_array_equal(completed[valid], distance[valid])
    assert np.isfinite(completed).all()
    if valid.any():  # averages of averages never leave the range, a box's corners its sides by sqrt(3), the rest is far
        assert completed.min() >= distance[valid].min() / 3**0.5 * (1 - ROUNDING)
        most = max(3**0.5 * distance[valid].max(), CONFIG.far * np.median(distance[valid]))
        assert completed.max() <= most * (1 + ROUNDING)
    else:
        assert (completed == 0).all()


@given(st.integers(0, H - 1), st.integers(0, W - 1), st.floats(0.125, 100.0, width=32))
@settings(max_examples=20, deadline=None)
def test_one_known_pixel_tells_the_scale_of_all(row, column, metres):
    valid = jnp.zeros((H, W), bool).at[row, column].set(True)
    completed = completed_of(jnp.where(valid, jnp.float32(metres), jnp.nan), valid, config=CompleteConfig(far=1.0))
    np.testing.assert_allclose(completed, metres, rtol=ROUNDING)


def test_a_panorama_turned_by_the_coarsest_cell_is_completed_turned():
    # 32 of 64 columns: the cells of the coarsest level (1 x 2), and so those of every level, fall onto each other.
    distance, valid = shell_distance(ROOM, H, W), all_but(range(12, 18), range(-4, 3))
    turned = completed_of(jnp.roll(distance, 32, axis=1), jnp.roll(valid, 32, axis=1), GLASS)
    expected = jnp.roll(completed_of(distance, valid, GLASS), 32, axis=1)
    np.testing.assert_allclose(turned, expected, rtol=ROUNDING)


def test_a_speck_is_filled_from_its_wall_and_a_window_is_far_on_the_seam_too():
    distance = shell_distance(ROOM, H, W)
    for column in (29, 0):
        speck, window = all_but([14, 15], [column - 1, column]), all_but(range(10, 20), range(column - 6, column + 6))
        filled = completed_of(jnp.where(speck, distance, 0.0), speck)
        # The ray turns 11 degrees across the speck and its rim; push-pull averages what it finds there.
        np.testing.assert_allclose(filled[~speck], distance[~speck], rtol=0.1)
        opened = completed_of(jnp.where(window, distance, 0.0), window, GLASS)
        far = CONFIG.far * jnp.median(distance[window])
        np.testing.assert_allclose(opened[14:16, column], far, rtol=ROUNDING)


def test_what_a_sensor_lost_goes_back_onto_the_room():
    """A hole that is no edge of the picture, a black one, one in the floor, and 60 % in blocks."""
    distance = shell_distance(ROOM, H, W)
    blocks = np.kron(np.random.default_rng(0).random((H // 4, W // 4)) > 0.6, np.ones((4, 4), bool))
    hole, below = all_but(range(10, 20), range(5, 17)), all_but(range(26, H), range(W))
    for valid, colour in ((hole, WALL), (hole, SHADOW), (below, GLASS), (blocks, WALL)):
        filled = completed_of(jnp.where(valid, distance, 0.0), valid, colour)
        # The shell's yaw is tried to a degree, and its walls are quantiles of pixels of 6 degrees.
        np.testing.assert_allclose(filled[~valid], distance[~valid], rtol=0.08)


def test_an_estimate_is_believed_where_it_says_outside():
    """The same hole as above, which the picture does not bear out, of a distance that was estimated."""
    distance, valid = shell_distance(ROOM, H, W), jnp.asarray(all_but(range(10, 20), range(5, 17)))
    rgb = jnp.full((H, W, 3), WALL)
    guessed = Panorama(rgb, jnp.where(valid, distance, 0.0), valid, jnp.zeros((H, W)))
    far = complete_distance(guessed, config=CONFIG)[14:16, 10]
    np.testing.assert_allclose(far, CONFIG.far * jnp.median(distance[valid]), rtol=ROUNDING)
