"""A guess belongs behind what was seen."""

import jax
import jax.numpy as jnp
import numpy as np

from rein3d_jax.explore.hidden import _MARGIN, _STEPS, hidden_distance, in_doubt, on_observed
from rein3d_jax.geometry.sphere import pixel_rays
from rein3d_jax.scene import Panorama

HEIGHT, WIDTH = 16, 32
RAYS = pixel_rays(HEIGHT, WIDTH)
ORIGIN = jnp.array([0.5, -0.3, 0.1])
STEP = 2 ** (2 / _STEPS)  # from one tried place to the next
SHAPE = (HEIGHT, WIDTH)


def seen_at(distance) -> Panorama:
    return Panorama(jnp.zeros((*SHAPE, 3)), jnp.broadcast_to(distance, SHAPE), jnp.ones(SHAPE, bool))


def from_centre(distance) -> np.ndarray:
    """Distance from the world's origin of the places `distance` metres from ORIGIN."""
    return np.linalg.norm(np.asarray(ORIGIN + RAYS * distance[..., None], np.float64), axis=-1)


def test_a_guess_in_seen_space_is_moved_just_behind_the_surface() -> None:
    """A ball of 2 m was seen. The guess lies 1.5 m from a camera within it."""
    moved = hidden_distance(seen_at(2.0), ORIGIN, RAYS, jnp.full(SHAPE, 1.5))
    reach = from_centre(moved)
    assert np.all(reach >= 2 * (1 - _MARGIN) - 1e-5)  # float32
    before = from_centre(moved / STEP)
    stays = np.asarray(moved) == 1.5  # was behind it already
    assert 0 < stays.mean() < 1
    np.testing.assert_array_equal(stays, from_centre(jnp.full(SHAPE, 1.5)) >= 2 * (1 - _MARGIN))
    assert np.all(before[~stays & (moved > 1.5)] < 2 * (1 - _MARGIN) + 1e-5)  # the nearest one tried, no farther


def test_a_hidden_guess_stays_to_the_bit() -> None:
    guess = jax.random.uniform(jax.random.key(0), SHAPE, minval=2.7, maxval=5.0)
    np.testing.assert_array_equal(hidden_distance(seen_at(2.0), ORIGIN, RAYS, guess), guess)


def test_where_nothing_is_hidden_there_is_no_guess() -> None:
    assert not np.any(hidden_distance(seen_at(10.0), ORIGIN, RAYS, jnp.full(SHAPE, 1.5)))


def test_what_was_lifted_lies_on_what_was_observed_and_a_guess_behind_does_not() -> None:
    surface = jax.random.uniform(jax.random.key(2), SHAPE, minval=0.8, maxval=4.0)
    assert np.all(on_observed(seen_at(surface), RAYS * surface[..., None]))
    assert not np.any(on_observed(seen_at(surface), RAYS * surface[..., None] * (1 + 2 * _MARGIN)))


def test_never_in_front_of_what_was_seen() -> None:
    """Any surface, any guess: 0, or a place behind the pixel it falls into."""
    keys = jax.random.split(jax.random.key(1), 2)
    surface = jax.random.uniform(keys[0], SHAPE, minval=0.8, maxval=4.0)
    guess = jax.random.uniform(keys[1], SHAPE, minval=0.5, maxval=4.0)
    moved = np.asarray(hidden_distance(seen_at(surface), ORIGIN, RAYS, guess), np.float64)
    points = np.asarray(ORIGIN, np.float64) + np.asarray(RAYS, np.float64) * moved[..., None]
    column = ((np.arctan2(-points[..., 1], points[..., 0]) / (2 * np.pi) + 0.5) * WIDTH).astype(int) % WIDTH
    reach = np.linalg.norm(points, axis=-1)
    row = np.clip((0.5 - np.arcsin(points[..., 2] / reach) / np.pi) * HEIGHT, 0, HEIGHT - 1).astype(int)
    in_front = (moved > 0) & (reach < np.asarray(surface)[row, column] * (1 - _MARGIN) - 1e-5)  # float32
    # A place within float32 of a pixel's border may be looked up on the other side of it here.
    assert in_front.sum() <= 1
    assert (moved > 0).mean() > 0.5
    assert np.all(moved <= 2.0001 * np.asarray(guess))


def test_what_is_in_doubt_is_told_by_direction() -> None:
    """The right half of the picture is doubtful."""
    doubt = jnp.where(jnp.arange(WIDTH) >= WIDTH // 2, 0.5, 0.0)
    panorama = seen_at(1.0).replace(doubt=jnp.broadcast_to(doubt, SHAPE))
    points = 3.0 * jnp.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])  # to the left, to the right
    np.testing.assert_array_equal(in_doubt(panorama, points), [False, True])
    assert not in_doubt(panorama.replace(doubt=None), points).any()
