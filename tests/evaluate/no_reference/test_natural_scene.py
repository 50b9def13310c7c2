"""NIQE and BRISQUE give the published packages' values; their parts are SciPy's."""

import numpy as np
import pytest
from scipy import ndimage, stats
from scipy.special import gamma

from rein3d_jax.evaluate.no_reference.brisque import brisque
from rein3d_jax.evaluate.no_reference.natural_scene import (
    fit_bell,
    halved,
    mean_of_width,
    moments,
    normalised_brightness,
    width_of_deviation,
)
from rein3d_jax.evaluate.no_reference.niqe import niqe
from rein3d_jax.io.weights.metric_weights import brisque_weights, niqe_weights

# basicsr 1.4.2's own niqe.py and matlab_functions.py, its Y channel (imports of the rest of it cut off)
NIQE = {
    ("view", "clean"): 6.97599,
    ("view", "noisy"): 12.27683,
    ("view", "blurred"): 9.82040,
    ("panorama", "clean"): 4.22894,
    ("panorama", "noisy"): 9.73218,
    ("panorama", "blurred"): 8.30350,
}
# brisque 0.2.0 with libsvm-official 3.37.0 (its features flattened, without which it fails with NumPy 2.4)
BRISQUE = {
    ("view", "clean"): -2.5443,
    ("view", "noisy"): 42.3881,
    ("view", "blurred"): 53.4609,
    ("panorama", "clean"): 4.6483,
    ("panorama", "noisy"): 43.8415,
    ("panorama", "blurred"): 55.9125,
}
# 770 terms up to 1024 cancel to some tens in float32. Measured: 1.3e-3 as compiled for use, 6e-3 as for tests.
CANCELS = 0.02


@pytest.mark.parametrize(("picture", "treatment"), NIQE)
def test_niqe_is_the_published_value(photos, picture, treatment):
    # A shape on the other side of a step of the authors' search, by rounding, moves the result by some 1e-3.
    value = niqe(niqe_weights(), photos[picture, treatment])
    np.testing.assert_allclose(value, NIQE[picture, treatment], atol=2e-3)


@pytest.mark.parametrize(("picture", "treatment"), BRISQUE)
def test_brisque_is_the_published_value(photos, picture, treatment):
    value = brisque(brisque_weights(), photos[picture, treatment])
    np.testing.assert_allclose(value, BRISQUE[picture, treatment], atol=CANCELS)


@pytest.mark.parametrize(("metric", "weights"), [(niqe, niqe_weights), (brisque, brisque_weights)])
def test_each_image_of_a_batch_has_its_own_value(photos, metric, weights):
    batch = np.stack([photos["panorama", "clean"], photos["panorama", "noisy"]])
    alone = [metric(weights(), image) for image in batch]
    np.testing.assert_allclose(metric(weights(), batch[:, None])[:, 0], alone, atol=CANCELS)


@pytest.mark.parametrize(("metric", "weights"), [(niqe, niqe_weights), (brisque, brisque_weights)])
def test_a_flat_picture_has_no_statistics(metric, weights):
    assert np.isnan(metric(weights(), np.full((192, 192, 3), 0.4, np.float32)))


def test_niqe_leaves_flat_blocks_out(photos):
    """A white wall beside the picture is no evidence."""
    wide = np.full((192, 288, 3), 0.7, np.float32)
    wide[:, :180] = photos["view", "clean"][:, :180]  # 12 columns of wall: the windows of the last blocks meet no more
    # Rounding moves a shape across a step of the authors' search.
    np.testing.assert_allclose(niqe(niqe_weights(), wide), niqe(niqe_weights(), wide[:, :192]), atol=2e-3)


def test_niqe_wants_two_blocks(photos):
    with pytest.raises(AssertionError, match="two blocks"):
        niqe(niqe_weights(), photos["view", "clean"][:180, :180])


@pytest.mark.parametrize(("beyond", "mode"), [("edge", "nearest"), ("constant", "constant")])
def test_brightness_is_normalised_as_scipy_would(photos, beyond, mode):
    plane = 255 * photos["view", "clean"][:64, :80, 1]
    offsets = np.arange(7) - 3
    window = np.exp(-(offsets[:, None] ** 2 + offsets**2) / (2 * (7 / 6) ** 2))
    window, exact = window / window.sum(), plane.astype(np.float64)
    mean = ndimage.convolve(exact, window, mode=mode)
    deviation = np.sqrt(np.abs(ndimage.convolve(exact**2, window, mode=mode) - mean**2))
    expected = (exact - mean) / (deviation + 1)
    # float32 sums of 49 products; a deviation near 0 is the root of a rounded difference
    np.testing.assert_allclose(normalised_brightness(plane, beyond=beyond), expected, atol=1e-3)


@pytest.mark.parametrize("shape", [0.5, 1.0, 2.0, 4.0])
def test_a_bell_is_recovered_from_its_samples(shape):
    rng = np.random.default_rng(0)
    size = np.abs(stats.gennorm.rvs(shape, size=200_000, random_state=rng))
    widths = np.array([1.0, 2.0])
    side = rng.choice(2, size=size.size, p=widths / widths.sum())  # the wider side has more of the samples
    values = np.where(side == 0, -1, 1) * size * widths[side]
    bell = fit_bell(moments(values.astype(np.float32)[None], zero_is_right=False))
    np.testing.assert_allclose(bell.shape, shape, rtol=0.03)  # moments of 200,000 samples
    widths_found = np.array([bell.left, bell.right]) * width_of_deviation(np.float32(shape))
    np.testing.assert_allclose(widths_found, widths, rtol=0.03)
    np.testing.assert_allclose(values.mean(), mean_of_width(np.float32(shape)) * 1.0, rtol=0.03)


def test_gamma_quotients_are_scipys():
    shapes = np.array([0.2, 0.7, 1.0, 3.3, 10.0])
    np.testing.assert_allclose(width_of_deviation(shapes), np.sqrt(gamma(1 / shapes) / gamma(3 / shapes)), rtol=2e-5)
    np.testing.assert_allclose(mean_of_width(shapes), gamma(2 / shapes) / gamma(1 / shapes), rtol=2e-5)


@pytest.mark.parametrize("taps", [(0.5, 0.5), (-0.09375, 0.59375, 0.59375, -0.09375)])
@pytest.mark.parametrize("beyond", ["symmetric", "edge"])
def test_halving_preserves_a_plane(taps, beyond):
    """A slope stays a slope, at the coarser pixels' centres, away from the border."""
    rows, columns = np.mgrid[:32, :48] + 0.5
    coarse = halved((3 * rows - 2 * columns).astype(np.float32), taps, beyond=beyond)
    rows, columns = 2 * (np.mgrid[:16, :24] + 0.5)
    np.testing.assert_allclose(coarse[2:-2, 2:-2], (3 * rows - 2 * columns)[2:-2, 2:-2], atol=1e-4)  # float32 of 100


@pytest.mark.bench
def test_the_brisque_package_agrees(photos):
    package = pytest.importorskip("brisque").BRISQUE
    scale = package.scale_features
    package.scale_features = lambda self, features: scale(self, [np.asarray(f, float).item() for f in features])
    oracle = package(url=False)
    for image in photos.values():
        expected = np.squeeze(oracle.score(np.round(255 * image).astype(np.uint8)))
        np.testing.assert_allclose(brisque(brisque_weights(), image), expected, atol=CANCELS)
