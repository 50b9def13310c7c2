"""Latitude-aware noise: each latent N(0, 1), no column special, correlated more towards the poles."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.restore.noise import draw_noise

HEIGHT, WIDTH, DRAWS = 8, 16, 10_000
LATITUDE = (0.5 - (np.arange(HEIGHT) + 0.5) / HEIGHT) * np.pi
COUNTS = np.round(WIDTH * np.cos(LATITUDE))
SPREAD = 5 / DRAWS**0.5  # five standard errors of a mean over the draws of one latent


def noise_of(kind):
    """(DRAWS, HEIGHT, WIDTH): each draw with a key, and so with phases, of its own."""
    keys = jax.random.split(jax.random.key(0), DRAWS)
    draw = jax.jit(jax.vmap(lambda key: draw_noise(key, (HEIGHT, WIDTH, 1), kind=kind)))
    return np.asarray(draw(keys))[..., 0]


@pytest.fixture(scope="module")
def latitude():
    return noise_of("latitude")


def correlation(noise, lag):
    """(HEIGHT, WIDTH): of each column with the one `lag` to its right, around the seam."""
    return (noise * np.roll(noise, -lag, axis=-1)).mean(axis=0)


def test_each_latent_is_a_standard_normal(latitude):
    np.testing.assert_allclose(latitude.mean(axis=0), 0, atol=SPREAD)
    np.testing.assert_allclose(latitude.var(axis=0), 1, atol=2**0.5 * SPREAD)
    np.testing.assert_allclose(
        (latitude**4).mean(axis=0), 3, atol=96**0.5 * SPREAD
    )  # the fourth power's variance is 96


def test_the_seam_is_no_special_place(latitude):
    """Correlation across it is that of any neighbours."""
    near = correlation(latitude, 1)
    np.testing.assert_allclose(near, near.mean(axis=1, keepdims=True).repeat(WIDTH, axis=1), atol=2 * SPREAD)


def test_rows_are_correlated_as_far_as_their_pixels_crowd(latitude):
    near, far = correlation(latitude, 1).mean(axis=1), correlation(latitude, WIDTH // 2).mean(axis=1)
    assert (np.diff(near[: HEIGHT // 2]) < 0).all()  # more towards the pole
    np.testing.assert_allclose(near, near[::-1], atol=2 * SPREAD)
    np.testing.assert_allclose(
        near[COUNTS == WIDTH], 0, atol=SPREAD
    )  # white where pixels are as wide as at the equator
    np.testing.assert_allclose(far[COUNTS > 3], 0, atol=2 * SPREAD)


def test_rows_frames_and_channels_are_independent():
    noise = np.asarray(draw_noise(jax.random.key(1), (2000, HEIGHT, WIDTH, 2)))
    for axis in (0, 1, 3):
        pairs = (noise * np.roll(noise, 1, axis=axis)).mean()
        # A row is worth at least 2 independent samples; five standard errors.
        assert abs(pairs) < 5 / (2000 * HEIGHT * 2 * 2) ** 0.5


def test_a_seed_gives_the_same_noise_and_white_is_white():
    shape = (3, HEIGHT, WIDTH, 4)
    np.testing.assert_array_equal(draw_noise(jax.random.key(3), shape), draw_noise(jax.random.key(3), shape))
    np.testing.assert_array_equal(
        draw_noise(jax.random.key(3), shape, kind="white"), jax.random.normal(jax.random.key(3), shape)
    )


def test_the_papers_warp_to_the_letter_loses_variance_and_tears_at_the_seam():
    """Why it is not the default."""
    noise = noise_of("paper")
    assert 0.6 < noise.var(axis=0).mean() < 0.75  # 2/3: the mean of (1-f)^2 + f^2
    near = correlation(noise, 1)
    assert (near[COUNTS < WIDTH - 2, -1] < 0.5 * near[COUNTS < WIDTH - 2, :-1].mean(axis=1)).all()


def test_an_unknown_kind_is_refused_by_name():
    with pytest.raises(InputError, match='"pink" is unknown; choose one of latitude'):
        draw_noise(jax.random.key(0), (2, 4, 1), kind="pink")


def test_a_row_of_one_cell_at_the_poles_works():
    assert np.isfinite(draw_noise(jax.random.key(0), (64, 4, 2))).all()
    assert draw_noise(jax.random.key(0), (64, 4, 2)).dtype == jnp.float32
