"""The blend: what was observed returns to the bit, a restorer's change of colours is undone, passes do not drift."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.restore.blend import TRUSTED, blend, match_colours, observed_share

SHAPE = (3, 32, 64)
KEYS = jax.random.split(jax.random.key(0), 3)
CLEAN = jax.random.uniform(KEYS[0], (*SHAPE, 3), minval=0.2, maxval=0.8)  # away from where colours are cut
ALPHA = jax.random.uniform(KEYS[1], SHAPE).at[:, 8:16].set(0.0).at[:, 20:].set(1.0)
HOLE = ALPHA < 0.5
GAIN, SHIFT = jnp.array([0.9, 1.1, 1.0]), jnp.array([0.08, -0.05, 0.03])


def tinted(rgb):
    """What a restorer makes of the colours of a whole clip."""
    return rgb * GAIN + SHIFT


def test_observed_pixels_return_to_the_bit_and_the_others_are_never_outside_0_to_1():
    guess = jnp.where(HOLE[..., None], 3 * jax.random.normal(KEYS[2], (*SHAPE, 3)), CLEAN)
    out = blend(guess, CLEAN, ALPHA, observed=0.5)
    np.testing.assert_array_equal(out[ALPHA >= TRUSTED], CLEAN[ALPHA >= TRUSTED])
    assert out.min() >= 0 and out.max() <= 1


def test_the_guesses_beside_observed_pixels_get_their_colours():
    rendered = jnp.where(HOLE[..., None], 0.0, CLEAN)  # nothing in a hole may count
    out = blend(tinted(CLEAN), rendered, ALPHA, observed=0.5)
    # 3 pixels of belief in no change, against a sum of squares about 3,000 * 0.03 and a tenth to undo.
    np.testing.assert_allclose(out, CLEAN, atol=3 / (3000 * 0.03) * 0.1)
    assert np.abs(tinted(CLEAN) - CLEAN).max() > 0.05


def test_passes_do_not_drift():
    """Each pass tints the clip and redraws the holes; without the blend ten of them are far off."""
    clip = plain = CLEAN
    for _ in range(10):
        clip, plain = blend(tinted(clip), CLEAN, ALPHA, observed=0.5), tinted(plain)
    drift, without = (np.abs((x - CLEAN)[HOLE].mean(axis=0)).max() for x in (clip, plain))
    assert drift < 0.01 and without > 0.1


def test_what_is_half_observed_is_mixed_without_a_step():
    alpha = jnp.linspace(0, 1, 1001)
    share = observed_share(alpha, 0.5)
    assert (share[alpha <= 0.5] == 0).all() and (share[alpha >= TRUSTED] == 1).all()
    assert np.diff(share).min() >= 0 and np.diff(share).max() < 0.003  # 1 / 400 of the way in each step
    np.testing.assert_array_equal(observed_share(alpha, 0.95), alpha >= 0.95)


@pytest.mark.parametrize("observed_pixels", [0, 1])
def test_a_clip_of_which_next_to_nothing_was_observed_keeps_its_colours(observed_pixels):
    share = jnp.zeros(SHAPE).at[0, 16, :observed_pixels].set(1.0)
    change = match_colours(CLEAN, CLEAN + 0.2, share) - CLEAN
    assert np.abs(change).max() <= 0.06 * observed_pixels  # one pixel against three pixels' worth of belief: 0.2 / 4


def test_poles_count_by_their_area():
    """A pole's row that disagrees weighs as little as it covers of the sphere."""
    rendered = CLEAN.at[:, 0].add(0.5)
    change = match_colours(CLEAN, rendered, jnp.ones(SHAPE)) - CLEAN
    area = np.cos(np.pi * (0.5 - 0.5 / 32))
    assert np.abs(change.mean()) < 2 * 0.5 * area / (32 * 2 / np.pi)
