"""A seam is measured as what it was made, and nothing is measured where there is none."""

import jax.numpy as jnp
import numpy as np

from rein3d_jax.evaluate.seam import seam_error

HEIGHT, WIDTH = 64, 128


def waves():
    """A picture that goes round: whole waves in azimuth."""
    azimuth = 2 * np.pi * np.arange(WIDTH) / WIDTH
    rows = np.linspace(0.2, 1.0, HEIGHT)[:, None]
    return np.stack([0.5 + 0.4 * rows * np.sin(k * azimuth + k) for k in (1, 2, 3)], axis=-1).astype(np.float32)


def test_a_picture_that_goes_round_has_no_seam_at_any_yaw():
    for shift in range(0, WIDTH, 9):
        # The jump changes from column to column by the wave's curvature: 255 * 0.4 * (3 * 2 pi / 128)^2 = 2.2 levels.
        # Where the slope changes sign, that much of the mean of three remains at most.
        assert abs(seam_error(np.roll(waves(), shift, axis=1))) < 2.2 / 2


def test_a_flat_picture_has_no_seam():
    assert seam_error(jnp.full((HEIGHT, WIDTH, 3), 0.3)) == 0


def test_a_step_is_measured_in_levels():
    """A ramp of one level a column that jumps back at the seam: 127 levels there, 1 beside it."""
    ramp = jnp.broadcast_to(jnp.arange(WIDTH)[None, :, None] / 255, (HEIGHT, WIDTH, 3))
    np.testing.assert_allclose(seam_error(ramp), 126.0, rtol=1e-5)  # float32 means


def test_an_edge_beside_the_seam_counts_against_it():
    """Signed: one column off, the same step gives minus a half of itself."""
    step = jnp.zeros((HEIGHT, WIDTH, 3)).at[:, 1 : WIDTH // 2].set(1.0)
    np.testing.assert_allclose(seam_error(step), -255 / 2, rtol=1e-5)


def test_rows_count_by_their_area():
    latitude = np.pi * (0.5 - (np.arange(HEIGHT) + 0.5) / HEIGHT)
    image = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    image[3, : WIDTH // 2] = 1.0
    expected = 255 * np.cos(latitude[3]) / np.cos(latitude).sum()
    np.testing.assert_allclose(seam_error(image), expected, rtol=1e-4)  # cos near a pole in float32
    both = seam_error(np.stack([image, 0.5 * image]))
    np.testing.assert_allclose(both, [expected, expected / 2], rtol=1e-4)
