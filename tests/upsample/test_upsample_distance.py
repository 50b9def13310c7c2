"""A distance map at a picture's size: planes stay planes, edges stay edges and follow the picture's."""

import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.geometry.sphere import pixel_rays
from rein3d_jax.upsample import coarser_distance, distance_for, finer_distance


def box(rows):
    """Distance (rows, 2 rows) to walls 1, 1.5 and 3 m away."""
    return jnp.min(jnp.array([3.0, 1.0, 1.5]) / jnp.maximum(jnp.abs(pixel_rays(rows, 2 * rows)), 1e-9), axis=-1)


def grey(rows):
    return jnp.full((rows, 2 * rows, 3), 0.5)


def disc(rows):
    """A disc 1 m away before a sphere of 2 m, and its picture: bright before dark."""
    inside = pixel_rays(rows, 2 * rows)[..., 0] > 0.9
    return jnp.where(inside, 1.0, 2.0), jnp.where(inside[..., None], 0.8, 0.2) * jnp.ones(3)


def test_the_same_size_is_the_same_map():
    distance = box(16)
    assert distance_for(grey(16), distance) is distance


def test_walls_grow_along_their_planes():
    small = box(64).at[20:24, 30:40].set(0)
    found = np.asarray(finer_distance(small, grey(256)))
    hole = np.kron(np.asarray(small) == 0, np.ones((4, 4), bool))
    np.testing.assert_array_equal(found == 0, hole)
    error = np.abs(found / np.asarray(box(256)) - 1)[~hole]
    assert np.percentile(error, 50) < 1e-3  # curvature of 1 / d between pixels of 2.8 degrees: their square / 8 = 3e-4


def test_walls_shrink_along_their_planes():
    """The middle of a block is the block's, where the nearest pixel's distance is half a pixel off."""
    error = np.abs(np.asarray(coarser_distance(box(128), rows=64) / box(64)) - 1)
    nearest = np.abs(np.asarray(box(128)[1::2, 1::2] / box(64)) - 1)
    assert np.median(error) < 2e-4 < 5e-3 < np.median(nearest)  # curvature, as above, of pixels of 1.4 degrees


@pytest.mark.parametrize("rows", [16, 24, 64, 100])
def test_nothing_lies_between_two_surfaces(rows):
    distance, _ = disc(32)
    _, picture = disc(rows)
    found = np.asarray(distance_for(picture, distance))
    assert found.shape == (rows, 2 * rows)
    np.testing.assert_allclose(
        np.minimum(np.abs(found - 1), np.abs(found - 2)), 0, atol=1e-4
    )  # float32: places at 100 of 32


def test_edges_go_where_the_pictures_are():
    distance, picture = disc(128)
    small = coarser_distance(distance, rows=32)
    wrong = [jnp.mean(jnp.abs(finer_distance(small, p) - distance) > 0.5) for p in (grey(128), picture)]
    assert wrong[1] < 0.2 * wrong[0]


def test_most_of_a_block_decides():
    block = jnp.array([[1.0, 1.0, 1.0, 3.0], [1.0, 3.0, 3.0, 3.0]])
    assert jnp.allclose(coarser_distance(block, rows=1), jnp.array([[1.0, 3.0]]))
    half_known = jnp.array([[1.0, 0.0, 0.0, 3.0], [1.0, 0.0, 0.0, 0.0]])
    assert jnp.allclose(coarser_distance(half_known, rows=1), jnp.array([[1.0, 0.0]]))
