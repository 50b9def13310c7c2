"""The backdrop behind windows."""

import jax.numpy as jnp
import numpy as np

from rein3d_jax.geometry.morphology import window_sum
from rein3d_jax.peel import outside_of

HERE = jnp.zeros((1, 3))


def test_a_room_without_windows_has_no_outside(empty):
    outside = outside_of(empty, HERE)
    assert not outside.there and not outside.shown.any()


def test_from_the_panorama_its_own_window_is_shown(with_window):
    outside = outside_of(with_window, HERE)
    wide = window_sum((~with_window.valid).astype(jnp.float32), 3) > 0  # a margin of 3 pixels
    assert outside.there
    np.testing.assert_array_equal(outside.shown, wide)


def test_more_places_show_more(with_window):
    beside = jnp.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
    one, more = (outside_of(with_window, jnp.concatenate([HERE, x])).shown for x in (HERE, beside))
    assert (more | ~one).all() and more.sum() > one.sum()


def test_it_goes_on_from_what_was_seen_and_forgets_it(with_window):
    outside = outside_of(with_window, HERE)
    rgb, row = np.asarray(outside.panorama.rgb)[..., 0], 14
    np.testing.assert_allclose(rgb[~np.asarray(with_window.valid)], 1.0, atol=1e-3)  # white; arccos near 1 in float32
    beside = rgb[row, 47:62]  # to the right of the window, above the horizon
    assert (np.diff(beside) < 0).all() and (beside >= 0.76 - 1e-6).all()  # towards a sky's mean
    assert (outside.panorama.distance > 20.0).all()  # behind what was seen
