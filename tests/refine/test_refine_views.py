"""Six views of 90 degrees tile the sphere and show what the panorama shows."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.geometry.pinhole import pinhole_rays
from rein3d_jax.geometry.poses import upright
from rein3d_jax.geometry.sphere import pixel_rays, world_from_camera_axes
from rein3d_jax.refine import ViewsConfig, join_views, views_from_panorama
from rein3d_jax.refine.views import camera_of

CONFIG = ViewsConfig(size=16)
HEIGHT, WIDTH = 64, 128
POSE = upright(jnp.array([0.3, 0.2, -0.1]), 0.7)
ONES = jnp.ones((HEIGHT, WIDTH))
YAWS = pytest.mark.parametrize("yaw", [0.0, 0.4])


def views_of(image, yaw):
    return views_from_panorama(image, ONES, POSE, yaw=yaw, config=CONFIG)


def world_rays(views) -> jax.Array:
    """(6, s, s, 3) through each pixel, in the world; z = 1 in the camera."""
    camera = camera_of(views, 0)
    rays = pinhole_rays(CONFIG.size, CONFIG.size, camera.focal, camera.centre)
    return jnp.einsum("mij,hwj->mhwi", views.world_from_camera[:, :3, :3], rays, precision="highest")


@YAWS
def test_a_constant_panorama_gives_constant_views(yaw) -> None:
    views = views_of(jnp.full((HEIGHT, WIDTH, 3), 0.3), yaw)
    np.testing.assert_allclose(views.rgb, 0.3, rtol=1e-6)  # float32: four weights that sum to 1
    np.testing.assert_allclose(views.weight, 1.0, rtol=1e-6)


@YAWS
def test_six_views_tile_the_sphere(yaw) -> None:
    """Their solid angles sum to 4 pi, and every direction falls into just one of them."""
    views = views_of(jnp.zeros((HEIGHT, WIDTH, 3)), yaw)
    angle = jnp.sum((2 / CONFIG.size) ** 2 * jnp.linalg.norm(world_rays(views), axis=-1) ** -3)
    np.testing.assert_allclose(angle, 4 * np.pi, rtol=2e-3)  # the midpoint rule at 16 pixels a side
    directions = np.random.default_rng(0).normal(size=(500, 3))
    axes = np.asarray(views.world_from_camera[:, :3, :3], np.float64)
    x, y, z = np.moveaxis(np.einsum("mij,ni->mnj", axes, directions), -1, 0)
    assert np.all(((z > np.abs(x)) & (z > np.abs(y))).sum(axis=0) == 1)


@YAWS
def test_a_panorama_coloured_by_direction_gives_each_ray_its_colour(yaw) -> None:
    rotation = jnp.matmul(POSE[:3, :3], world_from_camera_axes().T)
    directions = jnp.matmul(pixel_rays(HEIGHT, WIDTH), rotation.T, precision="highest")
    views = views_of(directions, yaw)
    rays = world_rays(views)
    expected = rays / jnp.linalg.norm(rays, axis=-1, keepdims=True)
    # Bilinear between rays 2.8 degrees apart: the chord's sag, (0.049)^2 / 8 an axis.
    np.testing.assert_allclose(views.rgb, expected, atol=1e-3)


def test_every_view_stands_where_the_panorama_was_taken_and_joins_in_order() -> None:
    views = views_of(jnp.zeros((HEIGHT, WIDTH, 3)), 0.4)
    np.testing.assert_array_equal(views.world_from_camera[:, :3, 3], jnp.tile(POSE[:3, 3], (6, 1)))
    both = join_views(views, views_of(jnp.ones((HEIGHT, WIDTH, 3)), 0.0))
    assert both.rgb.shape[0] == both.weight.shape[0] == both.focal.shape[0] == 12
    assert not np.any(both.rgb[:6]) and np.all(both.rgb[6:] > 0.99)
