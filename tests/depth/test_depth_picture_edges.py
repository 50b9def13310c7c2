"""Laws of edge support and of the colours that a split of the sphere explains."""

import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.depth.picture_edges import edge_support, edge_tensors
from rein3d_jax.depth.picture_parts import ROWS, colour_bins, mutual_information
from rein3d_jax.geometry.sphere import pixel_rays

H, W = 64, 128


def half_spaces(normal, step):
    """A grey picture with one edge: the great circle across `normal`."""
    side = pixel_rays(H, W) @ jnp.asarray(normal, jnp.float32) > 0
    return jnp.repeat((0.4 + step * side)[..., None], 3, axis=-1)


@pytest.mark.parametrize("step", [0.05, 0.5])
def test_support_is_high_along_an_edge_of_any_contrast_and_nowhere_else(step):
    normal = np.array([0.3, -0.5, 0.8]) / np.linalg.norm([0.3, -0.5, 0.8])
    tensors = edge_tensors(half_spaces(normal, step), noise=0.005, texture=1.0)
    first = np.cross(normal, [0.0, 0.0, 1.0]) / np.linalg.norm(np.cross(normal, [0.0, 0.0, 1.0]))
    second = np.cross(normal, first)
    angles = np.linspace(0, 2 * np.pi, 40)[:, None]
    circle = jnp.asarray(np.cos(angles) * first + np.sin(angles) * second, jnp.float32)
    circle = circle[jnp.abs(circle[:, 2]) < 0.8]  # at the poles a tangent frame turns within a pixel
    along = edge_support(tensors, circle, jnp.asarray(normal, jnp.float32))
    assert float(along.min()) > 0.3
    # A line that crosses the edge squarely runs along nothing: its plane holds the edge's normal.
    crossing = jnp.cross(circle, jnp.asarray(normal, jnp.float32))
    across = edge_support(tensors, circle, crossing)
    assert float(across.max()) < 0.1 * float(along.mean())
    beside = circle + 0.5 * jnp.asarray(normal, jnp.float32)
    assert float(edge_support(tensors, beside, jnp.asarray(normal, jnp.float32)).max()) < 0.01


def test_edges_turn_with_the_picture():
    picture = half_spaces([0.3, -0.5, 0.8], 0.3)
    rolled = edge_tensors(jnp.roll(picture, 37, axis=1), noise=0.005, texture=1.0)
    expected = jnp.roll(edge_tensors(picture, noise=0.005, texture=1.0), 37, axis=1)
    np.testing.assert_allclose(rolled, expected, atol=1e-4)  # float32 sums in another order, over small divisors


def test_a_flat_picture_has_no_edges():
    tensors = edge_tensors(jnp.full((H, W, 3), 0.7), noise=0.005, texture=1.0)
    np.testing.assert_allclose(tensors, 0, atol=1e-6)  # rounding of the blur, squared


def test_information_is_all_of_the_split_that_colours_follow_and_none_of_one_they_ignore():
    north = (pixel_rays(ROWS, 2 * ROWS)[..., 2] > 0).reshape(-1).astype(jnp.float32)
    east = (pixel_rays(ROWS, 2 * ROWS)[..., 1] < 0).reshape(-1).astype(jnp.float32)
    colours = north.reshape(ROWS, 2 * ROWS, 1) * jnp.array([0.5, 0.2, 0.1]) + 0.2
    bins = colour_bins(colours)
    np.testing.assert_allclose(bins.sum(), 1, atol=1e-5)  # float32 sum of 2048 shares
    follows = mutual_information(jnp.stack([north, 1 - north], axis=-1), bins)
    ignores = mutual_information(jnp.stack([east, 1 - east], axis=-1), bins)
    np.testing.assert_allclose(follows, np.log(2), atol=1e-4)  # two halves: one bit
    np.testing.assert_allclose(ignores, 0, atol=1e-4)
