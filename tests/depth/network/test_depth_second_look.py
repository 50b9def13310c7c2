"""Laws of the second look: lines and planes are inverse, strips show what is at a line, and it starts as nothing."""

import jax
import jax.numpy as jnp
import numpy as np

from rein3d_jax.depth.network.config import DepthNetworkConfig
from rein3d_jax.depth.network.network import estimate_depth, initial_depth_parameters
from rein3d_jax.depth.network.second_look import lines_of, planes_of, strips
from rein3d_jax.geometry.sphere import latitudes

SIZES = {"stem": 4, "channels": (4,) * 7, "blocks": (1,) * 7, "expand": 2, "horizon": 8, "heads": 2, "layers": 1}


def test_lines_and_planes_are_inverse():
    planes = jnp.exp(jax.random.uniform(jax.random.key(0), (2, 16, 2), minval=-2.0, maxval=1.0))
    np.testing.assert_allclose(planes_of(*lines_of(planes)), planes, rtol=1e-5)


def test_a_wall_at_the_cameras_height_meets_the_floor_at_45_degrees():
    floor, ceiling = lines_of(jnp.array([1.0, 2.0]))  # a ceiling at half the camera's height
    np.testing.assert_allclose(jnp.rad2deg(floor), 45, rtol=1e-6)
    np.testing.assert_allclose(jnp.tan(ceiling), 0.5, rtol=1e-6)


def test_strips_show_the_latitudes_around_a_line():
    rows, reach = 32, 4
    grid = jnp.broadcast_to(latitudes(rows)[:, None, None], (rows, 2 * rows, 1))[None]
    line = jnp.full((1, rows // 2), 0.4)
    found = strips(grid, line, reach).reshape(rows // 2, 4, 2 * reach + 1)  # four columns of the picture each
    expected = -(0.4 + np.arange(-reach, reach + 1) * np.pi / rows)
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), atol=1e-5)


def test_it_changes_nothing_before_it_has_learned(random_network):
    """Whatever the rest of the network has learned."""
    with_look = DepthNetworkConfig(**SIZES, decoder=(8,) * 5, looks=2)
    without = DepthNetworkConfig(**SIZES, decoder=(8,) * 5, looks=0)
    unlearned = jax.jit(lambda key: initial_depth_parameters(key, with_look)["look"])(jax.random.key(0))
    parameters = {**random_network(with_look), "look": unlearned}
    rgb = jax.random.uniform(jax.random.key(1), (1, 32, 64, 3))
    estimate = jax.jit(estimate_depth, static_argnums=2)
    both = [estimate(parameters, rgb, config).log_distance for config in (with_look, without)]
    np.testing.assert_allclose(*both, atol=1e-5)  # tangents and their inverses in float32
