"""Laws of the loss and of what an example is trained as: where the fills stand it is 1, and known facts stay known."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.geometry.sphere import latitudes
from rein3d_jax.restore.learned.augment import augment, shaded
from rein3d_jax.restore.learned.condition import CANDIDATES, Clip
from rein3d_jax.restore.learned.loss import (
    NOISE,
    Example,
    LossConfig,
    clean_residual,
    noisy_residual,
    pixel_weights,
    restoration_loss,
)
from rein3d_jax.restore.learned.mixture import base

COUNT, FRAMES, ROWS = 4, 3, 16
SHAPE = (FRAMES, ROWS, 2 * ROWS)
CONFIG = LossConfig()
# A quotient of two float32 sums of N = 1,536 penalties, none negative: each is off by sqrt(N) eps = 5e-6 of itself
# in any order, and so is each of the two quotients that are compared.
RTOL = 2e-5
penalty = jax.jit(restoration_loss, static_argnums=2)


def example_of(seed) -> Example:
    """Alpha of any value; the first frame is wholly observed; what is observed is rendered as it is."""
    rng = np.random.default_rng(seed)

    def values(*channels):
        return rng.random((*SHAPE, *channels), np.float32)

    alpha = np.clip(2 * values() - 0.5, 0, 1)
    alpha[0] = 1.0
    clean, distance = values(3), np.broadcast_to(1 + values()[0], SHAPE)  # seen from one place: nothing is hidden
    known = (alpha == 1)[..., None, None]
    fills = np.where(known, clean[..., None, :], values(CANDIDATES, 3))
    clip = Clip(
        clean * (alpha[..., None] > 0), alpha, distance * (alpha > 0), fills, 1 + values(CANDIDATES), np.zeros((3, 3))
    )
    return jax.tree.map(jnp.float32, Example(clip, clean, distance))


EXAMPLES = jax.tree.map(lambda *x: jnp.stack(x), *[example_of(seed) for seed in range(COUNT)])
WANTED = clean_residual(EXAMPLES)
FREE = EXAMPLES.clip.alpha < 0.9  # what an observed pixel's weight of 0 leaves to the network
FREE = FREE.at[:, 0].set(False)


def test_the_fills_mean_and_the_residual_make_the_clean_clip():
    together = base(EXAMPLES.clip) + WANTED
    np.testing.assert_allclose(together[..., :3], EXAMPLES.clean_rgb, atol=1e-6)  # one float32 sum
    np.testing.assert_allclose(jnp.exp(together[..., 3]), EXAMPLES.clean_distance, rtol=1e-5)


def test_every_example_counts_1_at_the_start_and_less_the_nearer_the_guess():
    losses = [penalty(share * WANTED, EXAMPLES, CONFIG) for share in (0.0, 0.5, 1.0)]
    np.testing.assert_allclose(losses[0][0], COUNT, rtol=RTOL)
    assert [float(weight) for _, weight in losses] == [COUNT] * 3
    start, nearer, there = (float(value) for value, _ in losses)
    assert start > nearer > there and there < 0.05 * start  # FLOOR over the penalty of random colours
    alone = penalty(jnp.zeros_like(WANTED[:1]), jax.tree.map(lambda x: x[:1], EXAMPLES), CONFIG)
    np.testing.assert_allclose(alone[0], 1.0, rtol=RTOL)


def test_the_anchor_and_observed_pixels_do_not_count():
    guess = jnp.where(FREE[..., None], WANTED, 100.0)
    assert float(penalty(guess, EXAMPLES, CONFIG)[0]) == float(penalty(WANTED, EXAMPLES, CONFIG)[0])
    slope = jax.grad(lambda x: penalty(x, EXAMPLES, CONFIG)[0])(jnp.zeros_like(WANTED))
    np.testing.assert_array_equal(slope[~FREE], 0.0)
    assert np.all(np.any(slope[FREE] != 0, axis=-1))


def test_a_batch_in_two_halves_sums_to_the_whole():
    guess = 0.3 * WANTED
    halves = [jax.tree.map(lambda x, part=part: x[part], (guess, EXAMPLES)) for part in (slice(0, 2), slice(2, 4))]
    sums = jax.tree.map(jnp.add, *[penalty(*half, CONFIG) for half in halves])
    jax.tree.map(partial(np.testing.assert_allclose, rtol=RTOL), sums, penalty(guess, EXAMPLES, CONFIG))


def test_latitude_weights_go_from_the_area_to_uniform():
    alpha, cosine = jnp.zeros(SHAPE), np.cos(latitudes(ROWS))
    for weight in (0.0, 0.1, 1.0):
        found = pixel_weights(alpha, LossConfig(latitude=weight))
        np.testing.assert_array_equal(found[0], 0.0)  # the anchor
        expected = np.broadcast_to((weight + (1 - weight) * cosine)[:, None], found[1:].shape)
        np.testing.assert_allclose(found[1:], expected, rtol=1e-6)  # float32
    with pytest.raises(InputError, match=r"latitude must be in \[0, 1\], not 1\.5"):
        LossConfig(latitude=1.5)


def test_a_pixels_weight_falls_as_more_of_it_was_observed():
    alpha = jnp.broadcast_to(jnp.linspace(0, 1, SHAPE[-1]), SHAPE)
    weights = pixel_weights(alpha, CONFIG)[1:]
    assert (np.diff(weights, axis=-1) <= 0).all() and not np.any(weights[alpha[1:] > 0.9])
    half = pixel_weights(alpha, LossConfig(observed=0.5))[1:]
    np.testing.assert_allclose(half[..., -1], 0.5 * half[..., 0], rtol=1e-6)  # float32


def test_at_share_0_the_level_is_1_and_the_residual_0():
    noisy, level = noisy_residual(jax.random.key(0), example_of(0), 0.0)
    assert float(level) == 1.0 and not np.any(noisy)


def test_a_noisy_residual_lies_on_the_straight_path_or_is_not_shown():
    one, levels = example_of(0), []
    draw = jax.jit(noisy_residual, static_argnums=(2, 3))
    for seed in range(12):
        noisy, level = draw(jax.random.key(seed), one, 0.5, "white")
        levels.append(float(level))
        if level == 1:
            assert not np.any(noisy)
        else:
            noise = (noisy - (1 - level) * clean_residual(one)) / level
            # Of N = 6,144 draws the deviation is known to 1 / sqrt(2 N) = 0.9 %, the mean to 1.3 % of it; five times.
            assert abs(noise.std() / NOISE - 1) < 0.05 and abs(noise.mean()) < 0.07 * NOISE
    assert 0 < sum(level == 1 for level in levels) < 12
    assert len(set(levels)) > 2


def test_an_augmented_example_keeps_what_is_known():
    """Yaws, mirrors and tones are shared: what was observed as it is stays as it is."""
    change = jax.jit(augment)
    for seed in range(6):
        before = example_of(seed)
        after = change(jax.random.key(seed), before)
        known = np.asarray(after.clip.alpha == 1)
        assert known.sum() == np.sum(before.clip.alpha == 1)
        # Shading: distances of up to 2 m, resampled at their own places, are off by float32's 1e-6 of the threshold.
        np.testing.assert_allclose(after.clip.rgb[known], after.clean_rgb[known], atol=1e-5)
        np.testing.assert_allclose(after.clip.distance[known], after.clean_distance[known])
        fills = np.broadcast_to(after.clean_rgb[known][:, None], after.clip.fill_rgb[known].shape)
        np.testing.assert_allclose(after.clip.fill_rgb[known], fills, atol=1e-5)
        assert np.abs(np.sort(after.clean_rgb.ravel()) - np.sort(before.clean_rgb.ravel())).max() > 0.01
        colours = jnp.concatenate([after.clip.rgb.ravel(), after.clean_rgb.ravel()])
        assert colours.min() >= 0 and colours.max() <= 1


def test_only_what_the_anchor_does_not_see_is_darkened():
    """One half of the last frame lies twice as far as what the anchor saw in its direction."""
    example = example_of(0)
    behind = example.replace(clean_distance=example.clean_distance.at[-1, :, ROWS:].multiply(2.0))
    ratio = shaded(behind, 0.5).clean_rgb / example.clean_rgb
    seen = np.ones(SHAPE, bool)
    seen[-1, :, ROWS - 1 :], seen[-1, :, 0] = False, False  # a soft border, one pixel wide; columns wrap
    seen[-1, [0, -1]] = False  # which reaches over the poles
    np.testing.assert_allclose(ratio[seen], 1.0, atol=1e-5)
    np.testing.assert_allclose(ratio[-1, 1:-1, ROWS + 1 : -1], np.exp(-0.5), rtol=1e-5)
