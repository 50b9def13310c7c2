"""Laws of halving and doubling on the sphere."""

import jax
import jax.numpy as jnp
import numpy as np

from rein3d_jax.geometry.pyramid import blocks, double, levels

HEIGHT, WIDTH = 8, 16
IMAGE = jax.random.uniform(jax.random.key(0), (HEIGHT, WIDTH, 2))


def test_levels_halve_down_to_two_rows_or_an_odd_height() -> None:
    assert [levels(h) for h in (2, 4, 8, 12, 128, 7)] == [0, 1, 2, 2, 6, 0]


def test_blocks_are_the_pixels_under_each_cell() -> None:
    cells = blocks(IMAGE)
    for row, column in np.ndindex(HEIGHT // 2, WIDTH // 2):
        under = IMAGE[2 * row : 2 * row + 2, 2 * column : 2 * column + 2].reshape(4, 2)
        np.testing.assert_array_equal(cells[row, column], under)


def test_a_constant_is_doubled_and_halved_to_itself() -> None:
    constant = jnp.full((HEIGHT, WIDTH), 0.7)
    np.testing.assert_allclose(double(constant), 0.7, rtol=1e-6)  # float32: 3/4 x + 1/4 x, twice
    np.testing.assert_array_equal(blocks(double(constant)).shape, (HEIGHT, WIDTH, 4))


def test_doubling_keeps_the_sum_and_the_range() -> None:
    """Each pixel gives 3/4 + 1/4 along each axis; beyond a pole it gives to itself, turned."""
    doubled = double(IMAGE)
    # float32 sums of n = 512 positive terms: sqrt(n) eps = 3e-6 of the sum in any order.
    np.testing.assert_allclose(doubled.sum(axis=(0, 1)), 4 * IMAGE.sum(axis=(0, 1)), rtol=1e-5)
    assert doubled.min() >= IMAGE.min() and doubled.max() <= IMAGE.max() + 1e-6


def test_doubling_turns_with_the_sphere() -> None:
    """Across the seam and over the poles alike."""
    rolled = double(jnp.roll(IMAGE, 3, axis=1))
    np.testing.assert_array_equal(rolled, jnp.roll(double(IMAGE), 6, axis=1))


def test_doubling_is_exact_for_a_ramp_of_rows() -> None:
    """Bilinear weights sit where the new centres lie; the outermost rows see the pole and are left out."""
    ramp = jnp.broadcast_to(jnp.arange(HEIGHT)[:, None] + 0.5, (HEIGHT, WIDTH))
    fine = (jnp.arange(2 * HEIGHT) + 0.5) / 2
    np.testing.assert_allclose(double(ramp)[1:-1, 0], fine[1:-1], rtol=1e-6)  # float32
