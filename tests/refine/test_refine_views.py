"""Six views of 90 degrees tile the sphere and show what the panorama shows."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.conventions import EQUIRECTANGULAR
from rein3d_jax.geometry.pinhole import pinhole_rays
from rein3d_jax.geometry.poses import upright
from rein3d_jax.geometry.sphere import pixel_rays, world_from_camera_axes
from rein3d_jax.refine import RefineConfig, join_views, views_from_panorama
from rein3d_jax.refine.views import camera_of

CONFIG = RefineConfig(crop=16)
HEIGHT, WIDTH = 64, 128
POSE = upright(jnp.array([0.3, 0.2, -0.1]), 0.7)
ONES = jnp.ones((HEIGHT, WIDTH))
DISTANCE = jnp.where(jnp.arange(WIDTH) < WIDTH // 2, 2.0, 5.0) * ONES  # two steps
TURNS = pytest.mark.parametrize("turn", [0.0, 0.4])


def views_of(image, turn):
    return views_from_panorama(image, ONES, DISTANCE, POSE, source=2, turn=turn, config=CONFIG)


def world_rays(views) -> jax.Array:
    """(6, s, s, 3) through each pixel, in the world; z = 1 in the camera."""
    camera = camera_of(views, 0)
    rays = pinhole_rays(CONFIG.crop, CONFIG.crop, camera.focal, camera.centre)
    return jnp.einsum("mij,hwj->mhwi", views.world_from_camera[:, :3, :3], rays, precision="highest")


@TURNS
def test_a_constant_panorama_gives_constant_views(turn) -> None:
    views = views_of(jnp.full((HEIGHT, WIDTH, 3), 0.3), turn)
    np.testing.assert_allclose(views.rgb, 0.3, rtol=1e-6)  # float32: four weights that sum to 1
    np.testing.assert_allclose(views.weight, 1.0, rtol=1e-6)


@TURNS
def test_six_views_tile_the_sphere(turn) -> None:
    """Their solid angles sum to 4 pi, and every direction falls into just one of them."""
    views = views_of(jnp.zeros((HEIGHT, WIDTH, 3)), turn)
    angle = jnp.sum((2 / CONFIG.crop) ** 2 * jnp.linalg.norm(world_rays(views), axis=-1) ** -3)
    np.testing.assert_allclose(angle, 4 * np.pi, rtol=2e-3)  # the midpoint rule at 16 pixels a side
    directions = np.random.default_rng(0).normal(size=(500, 3))
    axes = np.asarray(views.world_from_camera[:, :3, :3], np.float64)
    x, y, z = np.moveaxis(np.einsum("mij,ni->mnj", axes, directions), -1, 0)
    assert np.all(((z > np.abs(x)) & (z > np.abs(y))).sum(axis=0) == 1)


@TURNS
def test_a_panorama_coloured_by_direction_gives_each_ray_its_colour(turn) -> None:
    rotation = jnp.matmul(POSE[:3, :3], world_from_camera_axes().T)
    directions = jnp.matmul(pixel_rays(HEIGHT, WIDTH), rotation.T, precision="highest")
    views = views_of(directions, turn)
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


@TURNS
def test_distance_is_that_of_one_surface_or_unknown(turn) -> None:
    """No mean of the two sides of a step is fitted to."""
    distance = np.asarray(views_of(jnp.zeros((HEIGHT, WIDTH, 3)), turn).distance)
    near, far, unknown = (np.abs(distance - x) < 0.2 for x in (2, 5, 0))
    assert np.all(near | far | unknown) and near.mean() > 0.3 and far.mean() > 0.3
    assert unknown.any() == (turn > 0)  # at 0 the steps fall between pixels


def test_a_panorama_is_one_view_weighed_by_solid_angle() -> None:
    config = RefineConfig(crop=HEIGHT // 2, panoramic=True)
    rgb = jnp.asarray(np.random.default_rng(0).uniform(size=(HEIGHT, WIDTH, 3)), jnp.float32)
    views = views_from_panorama(rgb, ONES, DISTANCE, POSE, source=1, turn=0.0, config=config)
    assert views.rgb.shape == (1, 32, 64, 3)
    camera = camera_of(views, 0)
    assert camera.model == EQUIRECTANGULAR and int(views.source[0]) == 1
    np.testing.assert_allclose(camera.world_from_camera, POSE)
    weight = np.asarray(views.weight[0])
    np.testing.assert_allclose(weight.mean(), 1.0, rtol=1e-5)  # float32: a mean loss, as of perspective views
    latitude = (0.5 - (np.arange(32) + 0.5) / 32) * np.pi
    np.testing.assert_allclose(weight[:, 0] / weight[16, 0], np.cos(latitude) / np.cos(latitude[16]), rtol=1e-5)
