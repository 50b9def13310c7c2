"""Laws of the sRGB transfer."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.geometry.colour import linear_from_srgb, srgb_from_linear

LIGHT = np.linspace(0, 1, 501)


@pytest.mark.parametrize("asarray", [np.asarray, jnp.asarray])
def test_the_curves_undo_each_other(asarray) -> None:
    light = asarray(LIGHT)
    back = linear_from_srgb(srgb_from_linear(light))
    assert type(back) is type(light) and back.dtype == light.dtype
    np.testing.assert_allclose(back, light, atol=2e-6)  # float32 powers; the standard's bend leaves a step of 1e-8


def test_the_standards_points() -> None:
    np.testing.assert_allclose(
        linear_from_srgb(np.array([0.0, 0.04045, 0.5, 1.0])), [0, 0.0031308, 0.21404114, 1], atol=1e-7
    )


def test_gradients_are_finite_in_the_dark() -> None:
    assert np.isfinite(jax.vmap(jax.grad(srgb_from_linear))(jnp.array([0.0, 1e-9, 0.003, 1.0]))).all()
