"""The room behind what stands in it."""

import jax
import jax.numpy as jnp
import numpy as np

from rein3d_jax.geometry.poses import rigid
from rein3d_jax.geometry.sphere import world_from_camera_axes
from rein3d_jax.peel import behind_things, without_things
from tests.peel.conftest import ROWS, SHELL, box

POSE = rigid(world_from_camera_axes(), jnp.zeros(3))
ATOL = 1e-5  # float32 through a pyramid of means


def layer_of(panorama, shell=SHELL, rows=ROWS):
    taken = without_things(panorama, shell, POSE, rows=rows)
    return (taken, *behind_things(taken, taken, shell))


def test_an_empty_room_hides_nothing(empty):
    taken, _, hidden = layer_of(empty)
    assert not hidden.any()
    np.testing.assert_array_equal(taken.alpha, 1.0)


def test_a_thing_is_taken_away_and_a_pixel_around_it(furnished):
    taken, _, hidden = layer_of(furnished)
    gone = np.asarray(taken.alpha[1]) == 0
    assert gone[13:21, 19:29].all() and gone.sum() == 8 * 10
    # Behind the board alone is something hidden: around it the wall itself was seen.
    assert np.asarray(hidden)[14:20, 20:28].all() and hidden.sum() == 6 * 8


def test_the_layer_lies_on_the_walls(furnished):
    _, layer, _ = layer_of(furnished)
    np.testing.assert_allclose(layer.distance, box()[0].distance, rtol=ATOL)


def test_walls_that_are_not_quite_the_shell_go_on_behind_things(furnished):
    nearer = furnished.replace(distance=0.95 * furnished.distance)
    _, layer, hidden = layer_of(nearer)
    np.testing.assert_allclose(layer.distance[hidden], 0.95 * box()[0].distance[hidden], rtol=1e-4)


def test_rolling_the_room_rolls_the_layer(furnished):
    columns = 6
    rolled = jax.tree.map(lambda x: jnp.roll(x, columns, axis=1), furnished)
    shell = SHELL.replace(yaw=SHELL.yaw - columns * np.pi / ROWS)  # columns run to the right
    there, here = layer_of(rolled, shell)[2], layer_of(furnished)[2]
    np.testing.assert_array_equal(there, jnp.roll(here, columns, axis=1))


def test_what_lies_beyond_the_shell_stays(with_window):
    taken, _, hidden = layer_of(with_window)
    assert (taken.alpha == 1).all() and not hidden.any()


def test_a_larger_panorama_is_made_smaller():
    large = box(2 * ROWS)[0]
    taken = without_things(large, SHELL, POSE, rows=ROWS)
    blocks = np.asarray(large.rgb).reshape(ROWS, 2, 2 * ROWS, 2, 3).mean((1, 3))
    np.testing.assert_allclose(taken.rgb[0], blocks, atol=ATOL)
    assert set(np.unique(taken.distance[0])) <= set(np.unique(large.distance))  # nothing between two surfaces
