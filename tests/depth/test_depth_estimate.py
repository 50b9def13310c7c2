"""Laws of the whole estimate: it follows a yaw and the camera's height, and is the same twice."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.depth.estimate import estimate_distance
from rein3d_jax.depth.network.config import DepthNetworkConfig
from rein3d_jax.depth.room_shell import RoomShellConfig
from rein3d_jax.geometry.shell import RoomShell, meet_shell
from rein3d_jax.geometry.sphere import pixel_rays
from rein3d_jax.networks.depth import depth_shapes

H, W = 64, 128
TINY = DepthNetworkConfig(
    stem=4, channels=(4,) * 7, blocks=(1,) * 7, expand=2, horizon=8, heads=2, layers=1, decoder=(8, 8, 8, 8, 8)
)
pytestmark = pytest.mark.slow  # the shell's search compiles for some seconds


@pytest.fixture(scope="module")
def estimate(random_network):
    parameters = random_network(TINY)
    return lambda rgb, height=1.0: estimate_distance(rgb, parameters, height, config=TINY)


def room():
    shell = RoomShell(jnp.float32(0.3), jnp.array([1.5, 2.1, 1.9, 1.2]), jnp.float32(1.0), jnp.float32(0.75))
    _, face = meet_shell(shell, jnp.zeros(3), pixel_rays(H, W))
    return jax.random.uniform(jax.random.key(1), (6, 3))[face]


@pytest.fixture(scope="module")
def first(estimate):
    """The estimate of the room, which four tests compare others with."""
    return estimate(room())


def test_it_is_finite_positive_and_the_same_twice(estimate, first):
    second = estimate(room())
    for leaf, again in zip(jax.tree.leaves(first), jax.tree.leaves(second), strict=True):
        assert np.isfinite(leaf).all()
        np.testing.assert_array_equal(leaf, again)
    assert (first.distance > 0).all() and (first.doubt > 0).all()


@pytest.mark.parametrize("eighths", [1, 3, 6])
def test_a_yaw_by_eighths_of_a_circle_yaws_the_estimate(estimate, first, eighths):
    columns = eighths * W // 8
    turned = estimate(jnp.roll(room(), columns, axis=1)).distance
    # The very same picture is estimated: only a tie between two brightest eighths could turn it otherwise.
    np.testing.assert_array_equal(turned, jnp.roll(first.distance, columns, axis=1))


def test_metres_follow_the_camera_s_height(estimate, first):
    np.testing.assert_allclose(estimate(room(), 2.5).distance, 2.5 * first.distance, rtol=1e-6)


def test_it_exports_for_accelerators():
    rgb = jax.ShapeDtypeStruct((256, 512, 3), jnp.float32)
    whole = jax.jit(
        lambda rgb, parameters: estimate_distance(rgb, parameters, 1.6, config=TINY, shell=RoomShellConfig())
    )
    assert jax.export.export(whole, platforms=["cuda", "tpu"])(rgb, depth_shapes(TINY)).mlir_module_serialized
