"""Laws of the spherical-harmonic basis."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import sph_harm_y

from rein3d_jax.geometry.spherical_harmonics import basis, rgb_from_sh, sh_from_rgb


def sphere_quadrature() -> tuple[np.ndarray, np.ndarray]:
    """Gauss-Legendre in z times the trapezoid in azimuth: exact for polynomials up to degree 9 > 3 + 3."""
    z, weight = np.polynomial.legendre.leggauss(5)
    azimuth = np.arange(12) * 2 * np.pi / 12
    ring = np.sqrt(1 - z * z)[:, None]
    points = np.stack([ring * np.cos(azimuth), ring * np.sin(azimuth), np.broadcast_to(z[:, None], (5, 12))], axis=-1)
    return points.reshape(-1, 3), np.repeat(weight * 2 * np.pi / 12, 12)


def test_basis_is_orthonormal() -> None:
    points, weights = sphere_quadrature()
    values = np.asarray(basis(jnp.asarray(points, jnp.float32), 16))
    np.testing.assert_allclose(values.T @ (weights[:, None] * values), np.eye(16), atol=1e-6)  # float32 values


def test_basis_equals_the_closed_form() -> None:
    """3DGS keeps the Condon-Shortley phase of scipy's Y: sqrt(2) Re Y for m > 0, sqrt(2) Im Y of |m| for m < 0."""
    points, _ = sphere_quadrature()
    theta, phi = np.arccos(points[:, 2]), np.arctan2(points[:, 1], points[:, 0])
    columns = []
    for degree in range(4):
        for order in range(-degree, degree + 1):
            y = sph_harm_y(degree, abs(order), theta, phi)
            columns.append(y.real if order == 0 else np.sqrt(2) * (y.imag if order < 0 else y.real))
    values = basis(jnp.asarray(points, jnp.float32), 16)
    np.testing.assert_allclose(values, np.stack(columns, axis=-1), atol=2e-6)  # float32 cubics


@pytest.mark.parametrize("count", [1, 4, 9, 16])
def test_lower_degrees_are_a_prefix(count: int) -> None:
    points = jnp.asarray(sphere_quadrature()[0], jnp.float32)
    np.testing.assert_array_equal(basis(points, count), basis(points, 16)[:, :count])


def test_degree_zero_colour_comes_back_from_everywhere() -> None:
    points = jnp.asarray(sphere_quadrature()[0], jnp.float32)
    rgb = jnp.linspace(0, 1, 3 * len(points)).reshape(-1, 3)
    np.testing.assert_allclose(rgb_from_sh(sh_from_rgb(rgb)[:, None], points), rgb, atol=1e-6)  # one float32 division
