"""Metrics agree with their definitions written out in loops, and take their exact values at the limits."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from skimage.data import astronaut
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

from rein3d_jax.evaluate.coverage import coverage
from rein3d_jax.evaluate.metrics import psnr, ssim, ws_psnr, ws_ssim

HEIGHT, WIDTH = 16, 32


@pytest.fixture(scope="module")
def pair():
    rng = np.random.default_rng(0)
    image = rng.uniform(size=(HEIGHT, WIDTH, 3)).astype(np.float32)
    return image, np.clip(image + rng.normal(0, 0.1, image.shape), 0, 1).astype(np.float32)


def slow_ssim(x, y):
    """Wang et al. 2004, one window after the other, in float64."""
    offsets = np.arange(11) - 5
    window = np.exp(-(offsets[:, None] ** 2 + offsets**2) / (2 * 1.5**2))
    window /= window.sum()
    x, y, values = x.astype(np.float64), y.astype(np.float64), []
    for v, u, c in np.ndindex(x.shape[0] - 10, x.shape[1] - 10, 3):
        a, b = x[v : v + 11, u : u + 11, c], y[v : v + 11, u : u + 11, c]
        mean_a, mean_b = (window * a).sum(), (window * b).sum()
        variance_a, variance_b = (window * (a - mean_a) ** 2).sum(), (window * (b - mean_b) ** 2).sum()
        covariance = (window * (a - mean_a) * (b - mean_b)).sum()
        values.append(
            (2 * mean_a * mean_b + 1e-4)
            * (2 * covariance + 9e-4)
            / ((mean_a**2 + mean_b**2 + 1e-4) * (variance_a + variance_b + 9e-4))
        )
    return np.mean(values)


def test_ssim_is_its_definition(pair):
    # float32 E[x^2] - E[x]^2 loses about 1e-7 of variances near 0.1
    np.testing.assert_allclose(ssim(*pair), slow_ssim(*pair), atol=1e-5)


def test_psnr_and_ssim_are_those_of_scikit_image():
    photo = astronaut()[:192, 128:320] / 255.0
    noisy = np.clip(photo + np.random.default_rng(1).normal(0, 0.05, photo.shape), 0, 1)
    settings = {"gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False, "channel_axis": -1}
    # It averages over the places where the window fits, too; float64 there, float32 here.
    expected = structural_similarity(photo, noisy, data_range=1.0, **settings)
    np.testing.assert_allclose(ssim(noisy, photo), expected, atol=1e-5)
    np.testing.assert_allclose(psnr(noisy, photo), peak_signal_noise_ratio(photo, noisy, data_range=1.0), atol=1e-4)


def test_ws_ssim_is_its_definition(pair):
    """The slow SSIM of the 11 x 11 pixels that lie round each pixel on the sphere, weighted by cos(latitude)."""
    rows, columns = np.mgrid[-5:6, -5:6]
    total = weight = 0.0
    for v, u in np.ndindex(HEIGHT, WIDTH):
        row, column = rows + v, columns + u
        beyond = (row < 0) | (row >= HEIGHT)  # over the pole: the same distance this side of it, half way round
        row = np.where(row < 0, -1 - row, np.where(row >= HEIGHT, 2 * HEIGHT - 1 - row, row))
        column = (column + beyond * WIDTH // 2) % WIDTH
        share = np.cos(np.pi * (0.5 - (v + 0.5) / HEIGHT))
        total += share * slow_ssim(*(image[row, column] for image in pair))
        weight += share
    np.testing.assert_allclose(ws_ssim(*pair), total / weight, atol=1e-5)  # as above


def test_yawing_both_panoramas_changes_nothing():
    rng = np.random.default_rng(2)
    image = rng.uniform(size=(128, 256, 3)).astype(np.float32)
    noisy = np.clip(image + rng.normal(0, 0.1, image.shape), 0, 1).astype(np.float32)
    for metric in (ws_psnr, ws_ssim):
        yawed = metric(np.roll(noisy, 100, axis=1), np.roll(image, 100, axis=1))
        np.testing.assert_allclose(yawed, metric(noisy, image), atol=1e-4)  # the same sums in another order


def test_rows_weigh_by_their_area():
    """An error above 30 degrees of latitude, on a quarter of the sphere, is a quarter of the error."""
    image = jnp.zeros((96, 192, 3))
    # The midpoint rule is right to (pi / 96)^2 / 24 = 5e-5 of the area, 2e-4 dB.
    np.testing.assert_allclose(ws_psnr(image.at[:32].set(0.1), image), 20 + 10 * np.log10(4), atol=1e-3)


def test_equal_images_are_perfect(pair):
    image, _ = pair
    # a mean of 512 pixels whose quotients are 1 up to rounding: sqrt(512) * 6e-8
    np.testing.assert_allclose([ssim(image, image), ws_ssim(image, image)], 1.0, atol=3e-6)
    assert psnr(image, image) == ws_psnr(image, image) == jnp.inf


def test_ssim_is_symmetric_and_has_a_finite_gradient_at_its_maximum(pair):
    image, noisy = pair
    np.testing.assert_allclose(ssim(image, noisy), ssim(noisy, image), atol=1e-5)  # as in the definition's test
    gradient = jax.grad(ssim)(image, image)
    # The maximum is flat: what is left is rounding beside the 1e-3 or so of a gradient elsewhere.
    assert jnp.abs(gradient).max() < 1e-5 < jnp.abs(jax.grad(ssim)(noisy, image)).max()
    assert jnp.isfinite(jax.grad(ssim)(jnp.zeros_like(image), jnp.zeros_like(image))).all()


def test_a_known_error_has_a_known_psnr():
    image = jnp.full((HEIGHT, WIDTH, 3), 0.5)
    # float32 squares and a logarithm
    np.testing.assert_allclose(psnr(image + 0.1, image), 20.0, atol=1e-4)
    np.testing.assert_allclose(ws_psnr(image + 0.01, image), 40.0, atol=1e-3)


def test_psnr_counts_only_the_masked_pixels(pair):
    image, noisy = pair
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[3:7, 5:9] = True
    inside = psnr(noisy[3:7, 5:9], image[3:7, 5:9])
    np.testing.assert_allclose(psnr(noisy, image, weights=mask), inside, rtol=1e-5)  # float32 sums
    assert jnp.isnan(psnr(noisy, image, weights=np.zeros_like(mask)))


def test_each_image_of_a_batch_has_its_own_value(pair):
    image, noisy = pair
    batch = np.stack([noisy, noisy[::-1]]), np.stack([image, image])
    for metric in (psnr, ws_psnr, ssim, ws_ssim):
        alone = [metric(*both) for both in zip(*batch, strict=True)]
        np.testing.assert_allclose(metric(*batch), alone, rtol=1e-5)  # float32 sums in another order


def test_the_sphere_weighs_an_error_by_its_latitude():
    image = jnp.zeros((HEIGHT, WIDTH, 3))
    equator, pole = (ws_psnr(image.at[row].set(0.5), image) for row in (HEIGHT // 2, 0))
    latitude = np.pi * (0.5 - 0.5 / HEIGHT)
    ratio = np.cos(np.pi / 2 / HEIGHT) / np.cos(latitude)
    np.testing.assert_allclose(pole - equator, 10 * np.log10(ratio), atol=1e-3)  # cos near pi/2 in float32


def test_coverage_is_a_share_of_the_sphere():
    alpha = jnp.zeros((HEIGHT, WIDTH))
    assert coverage(alpha) == 0
    atol = 3e-6  # two float32 sums of 512 areas, of share 1 at most: sqrt(512) * 6e-8 each
    np.testing.assert_allclose(coverage(alpha.at[: HEIGHT // 2].set(1.0)), 0.5, atol=atol)
    quarter = (1 - np.sin(np.pi / 4)) / 2  # the cap above latitude 45 degrees
    np.testing.assert_allclose(coverage(alpha.at[: HEIGHT // 4].set(0.6)), quarter, atol=atol)
