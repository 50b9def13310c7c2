"""Laws of quaternions, covariances and the gradient-safe functions under them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.geometry.covariance import scaled_axes
from rein3d_jax.geometry.rotations import (
    matrix_from_quats,
    normalize_quats,
    quats_from_matrix,
    yaw_quat,
)
from rein3d_jax.geometry.safe import safe_divide, safe_norm

ATOL = 1e-5  # float32 through products of two 3 x 3 matrices of quadratic terms


def quats(seed: int, count: int = 50) -> jax.Array:
    return jax.random.normal(jax.random.key(seed), (count, 4))


def test_matrices_are_rotations() -> None:
    matrix = np.asarray(matrix_from_quats(quats(0)))
    np.testing.assert_allclose(matrix @ matrix.swapaxes(-1, -2), np.broadcast_to(np.eye(3), matrix.shape), atol=ATOL)
    np.testing.assert_allclose(np.linalg.det(matrix), 1, atol=ATOL)


def test_length_and_sign_name_the_same_rotation() -> None:
    q = quats(1)
    np.testing.assert_allclose(matrix_from_quats(-3.7 * q), matrix_from_quats(q), atol=ATOL)


def test_conjugate_is_the_inverse() -> None:
    conjugate = matrix_from_quats(quats(4) * jnp.array([1.0, -1.0, -1.0, -1.0]))
    np.testing.assert_allclose(conjugate, matrix_from_quats(quats(4)).swapaxes(-1, -2), atol=ATOL)


def test_yaw_turns_left_about_up() -> None:
    matrix = np.asarray(matrix_from_quats(yaw_quat(jnp.pi / 2)))
    np.testing.assert_allclose(matrix @ [1, 0, 0], [0, 1, 0], atol=ATOL)
    np.testing.assert_allclose(matrix @ [0, 0, 1], [0, 0, 1], atol=ATOL)


def test_the_zero_quaternion_is_the_identity_with_finite_gradient() -> None:
    np.testing.assert_array_equal(matrix_from_quats(jnp.zeros(4)), np.eye(3))
    assert np.all(np.isfinite(jax.grad(lambda q: matrix_from_quats(q).sum())(jnp.zeros(4))))


def test_scaled_axes_square_to_the_covariance() -> None:
    q, log_scales = quats(5), jax.random.normal(jax.random.key(6), (50, 3))
    axes = np.asarray(scaled_axes(log_scales, q))
    covariance = axes @ axes.swapaxes(-1, -2)
    expected = np.exp(2 * np.sort(np.asarray(log_scales), axis=-1))
    np.testing.assert_allclose(np.linalg.eigvalsh(covariance), expected, rtol=1e-3, atol=ATOL)  # e^6 between the ends


def test_a_matrix_gives_back_its_quaternion() -> None:
    """Up to sign; half turns about the axes included, where w is 0."""
    quats = normalize_quats(jnp.concatenate([jax.random.normal(jax.random.key(8), (100, 4)), jnp.eye(4)]))
    dot = jnp.sum(quats * quats_from_matrix(matrix_from_quats(quats)), axis=-1)
    np.testing.assert_allclose(jnp.abs(dot), 1, atol=1e-6)  # float32


def test_a_numpy_matrix_keeps_its_precision() -> None:
    matrix = np.array([[0.0, -0.6, 0.8], [1.0, 0.0, 0.0], [0.0, 0.8, 0.6]])
    w, *axis = quats_from_matrix(matrix)
    assert isinstance(w, np.float64) and w**2 + np.square(axis).sum() == pytest.approx(1, abs=1e-15)
    np.testing.assert_allclose(matrix @ axis, axis, atol=1e-15)  # float64


def test_safe_functions_at_and_off_their_singular_point() -> None:
    x = jax.random.normal(jax.random.key(7), (20, 3))
    np.testing.assert_allclose(safe_norm(x), np.linalg.norm(x, axis=-1), rtol=1e-6)  # float32
    assert safe_norm(jnp.zeros(3)) == 0
    np.testing.assert_array_equal(jax.grad(safe_norm)(jnp.zeros(3)), np.zeros(3))
    assert safe_divide(jnp.float32(1), jnp.float32(0), otherwise=7.0) == 7
    assert safe_divide(jnp.float32(3), jnp.float32(2)) == 1.5
    assert jax.grad(lambda d: safe_divide(jnp.float32(1), d))(jnp.float32(0)) == 0
