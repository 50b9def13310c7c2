"""Laws of the distance network: it follows a yaw, stays finite at any size, and knows the geometry of rooms."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.depth.network.config import DepthNetworkConfig
from rein3d_jax.depth.network.horizon import background_inverse, bands_of, to_columns
from rein3d_jax.depth.network.network import estimate_depth
from rein3d_jax.errors import InputError
from rein3d_jax.geometry.shell import RoomShell, meet_shell
from rein3d_jax.geometry.sphere import azimuths, pixel_rays
from rein3d_jax.networks.depth import depth_shapes

TINY = DepthNetworkConfig(
    stem=4, channels=(4,) * 7, blocks=(1,) * 7, expand=2, horizon=8, heads=2, layers=1, decoder=(8, 8, 8, 8, 8)
)


@pytest.fixture(scope="module")
def estimate(random_network):
    parameters = random_network(TINY)
    return jax.jit(lambda rgb: estimate_depth(parameters, rgb, TINY))


def picture(rows, seed=0):
    return jax.random.uniform(jax.random.key(seed), (2, rows, 2 * rows, 3))


@pytest.mark.parametrize("rows", [32, 96])
def test_every_output_has_the_pictures_shape_and_is_finite(estimate, rows):
    predicted = estimate(picture(rows))
    for leaf in jax.tree.leaves(predicted):
        assert leaf.shape == (2, rows, 2 * rows)
        assert jnp.isfinite(leaf).all()
    assert ((predicted.gate >= 0) & (predicted.gate <= 1)).all()


@pytest.mark.parametrize("strides", [1, 3])
def test_a_yaw_by_whole_strides_yaws_the_estimate(estimate, strides):
    rgb = picture(96)
    moved = estimate(jnp.roll(rgb, 32 * strides, axis=2))
    for before, after in zip(jax.tree.leaves(estimate(rgb)), jax.tree.leaves(moved), strict=True):
        # float32, sums over the columns in another order
        np.testing.assert_allclose(after, jnp.roll(before, 32 * strides, axis=2), atol=1e-4)


def test_it_exports_for_accelerators():
    shapes = depth_shapes(DepthNetworkConfig())
    rgb = jax.ShapeDtypeStruct((1, 128, 256, 3), jnp.float32)
    estimate = jax.jit(lambda parameters, rgb: estimate_depth(parameters, rgb, DepthNetworkConfig()))
    assert jax.export.export(estimate, platforms=["cuda", "tpu"])(shapes, rgb).mlir_module_serialized


def test_the_shipped_sizes_stay_small():
    assert 2 * sum(leaf.size for leaf in jax.tree.leaves(depth_shapes(DepthNetworkConfig()))) < 20e6  # bytes as float16


def test_the_background_of_a_box_is_its_distance():
    shell = RoomShell(jnp.float32(0.0), jnp.array([2.0, 1.5, 3.0, 1.2]), jnp.float32(1.0), jnp.float32(0.8))
    flat = jnp.stack([jnp.cos(azimuths(64)), -jnp.sin(azimuths(64)), jnp.zeros(64)], axis=-1)
    distance_to = jax.jit(lambda rays: meet_shell(shell, jnp.zeros(3), rays)[0])
    walls = 1 / distance_to(flat)
    inverse = jax.jit(background_inverse, static_argnums=2)(walls[None], jnp.full((1, 64), 1 / 0.8), 32)[0]
    np.testing.assert_allclose(1 / inverse, distance_to(pixel_rays(32, 64)), rtol=1e-4)


def test_columns_between_columns_lie_on_the_line_between_them():
    columns = jnp.arange(8.0)[None, :, None]
    fine = to_columns(columns, 32)[0, :, 0]
    np.testing.assert_allclose(fine[4:28], (np.arange(4, 28) + 0.5) / 4 - 0.5, atol=1e-6)
    np.testing.assert_allclose(to_columns(jnp.roll(columns, 1, 1), 32)[0, :, 0], jnp.roll(fine, 4), atol=1e-6)


@pytest.mark.parametrize("rows", [3, 4, 8, 13])
def test_bands_average_rows_and_keep_a_constant(rows):
    grid = jnp.ones((1, rows, 6, 2))
    np.testing.assert_allclose(bands_of(grid, 4), jnp.ones((1, 6, 8)), atol=1e-6)
    tall = jnp.broadcast_to(jnp.arange(float(rows))[:, None, None], (rows, 6, 2))[None]
    np.testing.assert_allclose(bands_of(tall, 4).mean(), (rows - 1) / 2, atol=1e-5)


def test_sizes_that_do_not_fit_are_refused():
    with pytest.raises(InputError, match="channels must be 7 numbers"):
        DepthNetworkConfig(channels=(4, 4))
    with pytest.raises(InputError, match="heads must divide horizon"):
        DepthNetworkConfig(heads=5)
