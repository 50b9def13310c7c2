"""Laws of the photometric loss and of the parameters it moves."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.refine.losses import photometric_loss
from rein3d_jax.refine.parameters import join_parameters, split_parameters, with_sh_degree
from rein3d_jax.scene import Gaussians

SIZE = 16
KEYS = jax.random.split(jax.random.key(0), 3)
IMAGE, TARGET = (jax.random.uniform(key, (SIZE, SIZE, 3)) for key in KEYS[:2])
WEIGHT = jax.random.uniform(KEYS[2], (SIZE, SIZE))
loss = jax.jit(lambda image, target, weight: photometric_loss(image, target, weight, ssim_weight=0.2))


def test_equal_images_have_no_loss() -> None:
    assert abs(float(loss(IMAGE, IMAGE, WEIGHT))) < 1e-6  # 1 - SSIM in float32


def test_loss_is_linear_in_the_weight() -> None:
    """Not divided by its sum: a view of guesses pulls less."""
    whole, half = loss(IMAGE, TARGET, WEIGHT), loss(IMAGE, TARGET, WEIGHT / 2)
    np.testing.assert_allclose(half, whole / 2, rtol=1e-5)  # float32 means
    assert whole > 0.01


@pytest.mark.parametrize("value", [0.0, 1.0, 1e3])
def test_what_has_no_weight_has_no_part(value) -> None:
    """Neither by its own difference nor through the windows that reach into it."""
    weight = WEIGHT.at[:, 6:9].set(0.0)
    gradient = jax.grad(loss)
    other = TARGET.at[:, 6:9].set(value)
    np.testing.assert_allclose(loss(IMAGE, other, weight), loss(IMAGE, TARGET, weight), rtol=1e-6)  # float32
    np.testing.assert_allclose(gradient(IMAGE, other, weight), gradient(IMAGE, TARGET, weight), atol=1e-9)


def test_pure_l1_is_the_mean_difference() -> None:
    value = photometric_loss(IMAGE, TARGET, jnp.ones((SIZE, SIZE)), ssim_weight=0.0)
    np.testing.assert_allclose(value, jnp.abs(IMAGE - TARGET).mean(), rtol=1e-6)  # float32


@pytest.mark.parametrize("degree", [0, 1, 3])
def test_splitting_and_joining_parameters_are_inverse(degree) -> None:
    count = 5
    leaves = [
        jax.random.normal(key, (count, k)) for key, k in zip(jax.random.split(KEYS[0], 3), (3, 3, 4), strict=True)
    ]
    sh = jax.random.normal(KEYS[1], (count, (degree + 1) ** 2, 3))
    scene = Gaussians(*leaves, jnp.arange(5.0), sh, jnp.arange(count) % 2 == 0)
    for before, after in zip(
        jax.tree.leaves(scene), jax.tree.leaves(join_parameters(split_parameters(scene), scene.alive)), strict=True
    ):
        np.testing.assert_array_equal(before, after)
    higher = with_sh_degree(scene, 3).sh
    np.testing.assert_array_equal(higher[:, : sh.shape[1]], sh)
    assert higher.shape[1] == 16 and not np.any(higher[:, sh.shape[1] :])
