"""Depthwise convolutions as sums of shifts: against a loop, and their own gradients against autodiff's."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.depth.network.convolution import convolve, depthwise, pad_grid, shifts


def summed(grid, kernel, stride):
    weights = kernel.reshape(-1, kernel.shape[-1])
    return sum(w * x for w, x in zip(weights, shifts(grid, kernel.shape[0], stride), strict=True))


def drawn(size, stride):
    keys = jax.random.split(jax.random.key(size + stride))
    return jax.random.normal(keys[0], (2, 6, 12, 3)), jax.random.normal(keys[1], (size, size, 3))


@pytest.mark.parametrize(("size", "stride"), [(3, 1), (5, 1), (3, 2), (5, 2)])
def test_depthwise_is_xlas_grouped_convolution(size, stride):
    grid, kernel = drawn(size, stride)
    expected = jax.lax.conv_general_dilated(
        pad_grid(grid, size, stride), kernel[:, :, None], (stride, stride), "VALID",
        dimension_numbers=("NHWC", "HWIO", "NHWC"), feature_group_count=3,
    )  # fmt: skip
    np.testing.assert_allclose(depthwise(grid, kernel, stride), expected, atol=1e-5)  # float32 sums of 25


@pytest.mark.parametrize(("size", "stride"), [(3, 1), (5, 1), (3, 2), (5, 2)])
def test_its_gradients_are_autodiffs(size, stride):
    pair = drawn(size, stride)
    ours, theirs = (
        jax.grad(lambda x, w, f=f: jnp.sum(f(x, w, stride) ** 3), (0, 1))(*pair) for f in (depthwise, summed)
    )
    for a, b in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-5 * float(jnp.abs(b).max()))


def test_a_full_convolution_of_one_channel_is_the_depthwise_one():
    grid, kernel = drawn(3, 2)
    np.testing.assert_allclose(
        convolve(grid[..., :1], kernel[..., :1, None], 2), depthwise(grid[..., :1], kernel[..., :1], 2), atol=1e-5
    )
