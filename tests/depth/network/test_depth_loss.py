"""The loss is zero at the truth but for the likelihood, ignores what has no distance, and weighs errors by area."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.depth.network.loss import DepthExample, DepthLossConfig, gradient_penalty
from rein3d_jax.depth.network.loss import depth_loss as eager_loss
from rein3d_jax.depth.network.network import DepthPrediction

PLAIN = DepthLossConfig(likelihood=0.0, unknown=0.0)
depth_loss = jax.jit(eager_loss, static_argnums=2)


@jax.jit
def truth():
    distance = jnp.exp(0.3 * jax.random.normal(jax.random.key(0), (2, 16, 32)))
    return DepthExample(jnp.zeros((2, 16, 32, 3)), distance.at[:, :, 5:9].set(0.0), distance)


def exact(example):
    log = jnp.log(example.background)
    return DepthPrediction(log, jnp.zeros_like(log), jnp.zeros_like(log), log, jnp.ones_like(log))


def test_it_is_zero_at_the_truth():
    penalty, count = depth_loss(exact(truth()), truth(), PLAIN)
    np.testing.assert_allclose(penalty, 0.0, atol=1e-4)  # normals of float32 differences
    assert count == 2


def test_what_has_no_distance_gives_no_gradient():
    example = truth()

    def loss(log):
        return depth_loss(exact(example).replace(log_distance=log), example, PLAIN)[0]

    slope = jax.jit(jax.grad(loss))(
        jnp.log(example.background) + 0.1 * jax.random.normal(jax.random.key(1), (2, 16, 32))
    )
    assert jnp.isfinite(slope).all()
    np.testing.assert_array_equal(slope[:, :, 5:9], 0.0)
    assert (jnp.abs(slope[:, :, 12:30]) > 0).mean() > 0.9


def test_one_factor_everywhere_costs_its_log_and_no_gradient_penalty():
    example, only = truth(), DepthLossConfig(background=0, normals=0, likelihood=0, unknown=0)
    moved = exact(example).replace(log_distance=jnp.log(example.background) + 0.2)
    np.testing.assert_allclose(depth_loss(moved, example, only)[0], 2 * 0.2, rtol=1e-4)
    step = jnp.zeros((1, 16, 32)).at[:, :, 16:].set(1.0)
    assert gradient_penalty(step, jnp.ones((1, 16, 32)), 1) == pytest.approx(2 / 32)  # two edges around the circle


def test_the_best_scale_is_the_mean_error():
    example, only = truth(), DepthLossConfig(background=0, gradients=0, normals=0, likelihood=1, unknown=0)

    def loss(scale):
        wrong = exact(example).replace(
            log_distance=jnp.log(example.background) + 0.3, log_scale=jnp.full((2, 16, 32), scale)
        )
        return depth_loss(wrong, example, only)[0]

    assert abs(jax.jit(jax.grad(loss))(jnp.log(0.3))) < 1e-4
