"""Laws of the tone mapping: blind to the unit of light and to yaw, monotone, finite, grey to grey."""

import numpy as np
import pytest

from rein3d_jax.io.pictures.tone import KEY, exposure, filmic, tone_map

RNG = np.random.default_rng(0)
LIGHT = np.exp(3 * RNG.standard_normal((16, 32, 3))).astype(np.float32)
ATOL = 1e-5  # float32 logarithms summed over 512 pixels


@pytest.mark.parametrize("unit", [1e-6, 0.3, 1e6])
def test_unit_of_light_does_not_matter(unit):
    np.testing.assert_allclose(tone_map(LIGHT * np.float32(unit)), tone_map(LIGHT), atol=ATOL)


def test_yawed_panorama_gives_yawed_picture():
    np.testing.assert_allclose(tone_map(np.roll(LIGHT, 5, axis=1)), np.roll(tone_map(LIGHT), 5, axis=1), atol=ATOL)


def test_exposure_weighs_rows_by_their_area():
    """Two bands, light a below and b above 30 degrees of latitude: half of the sphere lies within +-30 degrees."""
    rows = 96
    latitude = (0.5 - (np.arange(rows) + 0.5) / rows) * np.pi
    light = np.where(np.abs(latitude) < np.pi / 6, 4.0, 1.0)[:, None, None] * np.ones((rows, 2 * rows, 3), np.float32)
    # Log-average sqrt(4 * 1); the rows' midpoint rule is right to its h^2 / 24 = 5e-5.
    np.testing.assert_allclose(exposure(light.astype(np.float32)), KEY / 2, rtol=1e-4)


def test_curve_is_monotone_and_ends_in_white():
    x = np.linspace(0, 16, 4096)
    assert filmic(0.0) == 0 and (np.diff(filmic(x)) > 0).all() and filmic(8.0) >= 1


@pytest.mark.parametrize("wild", [np.nan, np.inf, -np.inf, -5.0, 3e38])
def test_wild_light_stays_finite_and_local(wild):
    light = LIGHT.copy()
    light[4, 7] = wild
    mapped = tone_map(light)
    assert mapped.dtype == np.float32 and np.isfinite(mapped).all() and mapped.min() >= 0 and mapped.max() <= 1
    mapped[4, 7] = tone_map(LIGHT)[4, 7]
    # One pixel of 512 moves the log-average; -5 becomes black, at most 1e-4 of the median: 9 / 512 of a log unit.
    np.testing.assert_allclose(mapped, tone_map(LIGHT), atol=0.1)


def test_black_stays_black():
    assert not tone_map(np.zeros((16, 32, 3), np.float32)).any()
