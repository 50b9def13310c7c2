"""The filter of a pixel, against eigenvalues in float64."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.rasterize import ADDED, LEAST, RasterizeConfig
from rein3d_jax.rasterize.pixel_filter import filtered

COUNT = 300
VARIANCE = 1 / 12


def footprints() -> np.ndarray:
    """(COUNT, 2, 3) pixels, from specks to a thousand pixels, two thirds of them needles of up to 1 : 1000."""
    noise = np.random.default_rng(0)
    turn = np.linalg.qr(noise.normal(size=(COUNT, 2, 2)))[0]
    sigmas = 10 ** noise.uniform(-3, 3, (COUNT, 2))
    sigmas[: COUNT // 3, 1] = sigmas[: COUNT // 3, 0]
    sigmas = np.maximum(sigmas, sigmas.max(1, keepdims=True) / 1000)
    return np.einsum("nij,nj,njk->nik", turn, sigmas, np.linalg.qr(noise.normal(size=(COUNT, 3, 3)))[0][:, :2])


@pytest.mark.parametrize("kind", [LEAST, ADDED])
def test_eigenvalues_are_widened_and_directions_stay(kind) -> None:
    spread = footprints()
    (xx, xy, yy, det), factor = filtered(jnp.float32(spread), VARIANCE, config=RasterizeConfig(filter=kind))
    values, vectors = np.linalg.eigh(spread @ np.swapaxes(spread, 1, 2))
    wide = np.sqrt(values**2 + VARIANCE**2) if kind == LEAST else values + VARIANCE
    expected = np.einsum("nij,nj,nkj->nik", vectors, wide, vectors)
    actual = np.stack([np.stack([xx, xy], -1), np.stack([xy, yy], -1)], -2)
    # Float32 of the larger eigenvalue, a needle's smaller one by the determinant.
    size = wide.max(1)[:, None, None]
    np.testing.assert_allclose(actual / size, expected / size, atol=1e-5)
    np.testing.assert_allclose(det, wide.prod(1), rtol=1e-3)  # of a needle of 1 : 1000, by a cross product
    # Opacity times area stays.
    np.testing.assert_allclose(factor, 0.5 * np.log(values.prod(1) / wide.prod(1)), atol=2e-3)


def test_least_adds_nothing_to_what_is_large_and_makes_a_pixel_of_a_speck() -> None:
    config = RasterizeConfig(antialias=False)
    for sigma, expected in ((1e-6, VARIANCE), (1e3, 1e6)):
        (xx, xy, yy, det), factor = filtered(sigma * jnp.eye(2, 3)[None], VARIANCE, config=config)
        np.testing.assert_allclose([xx[0], xy[0], yy[0]], expected * np.array([1, 0, 1]), rtol=1e-5, atol=1e-9)
        np.testing.assert_allclose(det[0], expected**2, rtol=1e-5)
        assert factor[0] == 0


@pytest.mark.parametrize("kind", [LEAST, ADDED])
@pytest.mark.parametrize("sigmas", [(0.0, 0.0), (1e-9, 1e-9), (1.0, 0.0), (1e6, 1e-3), (1e9, 1e9)])
def test_gradients_are_finite_at_any_size(kind, sigmas) -> None:
    def total(spread):
        covariance, factor = filtered(spread, VARIANCE, config=RasterizeConfig(filter=kind))
        return sum(jnp.sum(jnp.log(jnp.abs(x) + 1)) for x in covariance) + jnp.sum(factor)

    spread = jnp.array(sigmas)[:, None] * jnp.eye(2, 3)
    value, gradient = jax.value_and_grad(total)(spread[None])
    assert jnp.isfinite(value) and jnp.isfinite(gradient).all()
