"""Laws of window sums and closing on the sphere."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.geometry.morphology import closing, window_sum

HEIGHT, WIDTH = 16, 32
RADIUS = 2


def mask_of(seed: int) -> jax.Array:
    return jax.random.bernoulli(jax.random.key(seed), 0.85, (HEIGHT, WIDTH))


def test_window_sum_is_the_sum_over_the_window() -> None:
    image = np.random.default_rng(0).random((HEIGHT, WIDTH), np.float32)
    sums = window_sum(jnp.asarray(image), RADIUS)
    rows, columns = np.arange(5, 10), np.arange(-2, 3)  # a column at the seam
    # A float32 sum of n = 25 positive terms: n eps / 2 of it in the worst order.
    np.testing.assert_allclose(sums[7, 0], image[np.ix_(rows, columns)].sum(), rtol=2e-6)


def test_a_window_over_the_pole_comes_down_on_the_other_side() -> None:
    spike = jnp.zeros((HEIGHT, WIDTH)).at[0, 20].set(1.0)
    assert window_sum(spike, 1)[0, 20] == 1 and window_sum(spike, 1)[0, 20 - WIDTH // 2] == 1


@pytest.mark.parametrize("seed", range(4))
def test_closing_is_extensive_idempotent_and_increasing(seed) -> None:
    mask = mask_of(seed)
    closed = closing(mask, RADIUS)
    assert not np.any(mask & ~closed)
    np.testing.assert_array_equal(closing(closed, RADIUS), closed)
    more = closing(mask | mask_of(seed + 10), RADIUS)
    assert not np.any(closed & ~more)


@pytest.mark.parametrize("seed", range(2))
def test_closing_turns_with_the_sphere(seed) -> None:
    mask = mask_of(seed)
    np.testing.assert_array_equal(closing(jnp.roll(mask, 5, 1), RADIUS), jnp.roll(closing(mask, RADIUS), 5, 1))


@pytest.mark.parametrize("column", [0, 7, WIDTH - 1])  # at the seam too
def test_a_crack_is_closed_and_a_hole_is_not(column) -> None:
    crack = jnp.ones((HEIGHT, WIDTH), bool).at[:, column].set(False)
    assert np.all(closing(crack, RADIUS))
    hole = jnp.roll(jnp.ones((HEIGHT, WIDTH), bool).at[5:10, :5].set(False), column, axis=1)  # an open square of 5
    np.testing.assert_array_equal(closing(hole, RADIUS), hole)


def test_nothing_closes_to_nothing() -> None:
    assert not np.any(closing(jnp.zeros((HEIGHT, WIDTH), bool), RADIUS))
