"""Laws of the equirectangular maps."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.geometry.poses import rigid, upright
from rein3d_jax.geometry.sphere import (
    azimuths,
    horizontal_direction,
    pixel_rays,
    pixel_solid_angles,
    pixels_from_rays,
    rays_of_pose,
    rays_of_pose64,
    world_from_camera_axes,
)


def test_unproject_then_project_is_the_identity() -> None:
    """To 1e-3 pixel at 512 x 1024 in float32, for points metres away and not only unit rays."""
    height, width = 512, 1024
    distance = 0.5 + 9 * jax.random.uniform(jax.random.key(0), (height, width, 1))
    u, v = pixels_from_rays(pixel_rays(height, width) * distance, height, width)
    np.testing.assert_allclose(u, np.broadcast_to(np.arange(width) + 0.5, (height, width)), atol=1e-3, rtol=0)
    np.testing.assert_allclose(v, np.broadcast_to(np.arange(height)[:, None] + 0.5, (height, width)), atol=1e-3, rtol=0)


def test_project_then_unproject_is_the_identity() -> None:
    rays = jax.random.normal(jax.random.key(1), (1000, 3))
    rays /= jnp.linalg.norm(rays, axis=-1, keepdims=True)
    u, v = pixels_from_rays(rays, 16, 32)
    azimuth, latitude = (u / 32 - 0.5) * 2 * jnp.pi, (0.5 - v / 16) * jnp.pi
    up = jnp.array([0.0, 0.0, 1.0])
    back = jnp.cos(latitude)[:, None] * horizontal_direction(azimuth) + jnp.sin(latitude)[:, None] * up
    np.testing.assert_allclose(back, rays, atol=2e-6)  # a dozen float32 roundings of numbers up to pi


@pytest.mark.parametrize(
    ("direction", "pixel"),
    [
        ((1, 0, 0), (16, 8)),  # the centre column, the horizon
        ((0, -1, 0), (24, 8)),  # right is a quarter turn on
        ((0, 1, 0), (8, 8)),  # left
        ((0, 0, 1), (16, 0)),  # the zenith is the upper edge, at any column; the centre one is named
        ((0, 0, -1), (16, 16)),
    ],
)
def test_axes_land_where_the_conventions_say(direction: tuple, pixel: tuple) -> None:
    u, v = pixels_from_rays(jnp.array(direction, jnp.float32), 16, 32)
    np.testing.assert_allclose((u, v), pixel, atol=1e-5)  # one rounding of arctan2


def test_seam_stays_inside_the_picture() -> None:
    """A hair on either side of azimuth 180 degrees is column 0 or column w, never beyond."""
    rays = jnp.array([[-1.0, 1e-7, 0.0], [-1.0, -1e-7, 0.0], [-1.0, 0.0, 0.0], [-1.0, -0.0, 0.0]])
    u, _ = pixels_from_rays(rays, 16, 32)
    assert np.all((np.asarray(u) >= 0) & (np.asarray(u) <= 32))
    assert np.all(np.minimum(u, 32 - u) < 1e-5)  # 32 times float32's rounding


def test_rays_are_unit_and_turn_with_the_columns() -> None:
    rays = np.asarray(pixel_rays(8, 16))
    np.testing.assert_allclose(np.linalg.norm(rays, axis=-1), 1, atol=3e-7)  # float32 rounding of three squares
    turn = 2 * np.pi / 16  # one column to the right is a turn to the right about +Z
    right = np.array([[np.cos(turn), np.sin(turn), 0], [-np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    np.testing.assert_allclose(np.roll(rays, -1, axis=1), rays @ right.T, atol=1e-6)  # float32 sines


def test_solid_angles_cover_the_sphere() -> None:
    angles = np.asarray(pixel_solid_angles(64, 128), np.float64)
    assert np.all(angles > 0)
    assert angles.sum() == pytest.approx(4 * np.pi, rel=1e-6)  # 8192 float32 terms
    # Small pixels: the solid angle is height x width x cos(latitude).
    flat = (np.pi / 64) ** 2 * np.linalg.norm(np.asarray(pixel_rays(64, 128))[..., :2], axis=-1)
    np.testing.assert_allclose(angles, flat, rtol=2e-4)  # next term (pi / 64)^2 / 24


def test_camera_axes_look_along_the_centre_column() -> None:
    axes = np.asarray(world_from_camera_axes())
    np.testing.assert_array_equal(axes @ axes.T, np.eye(3))
    assert np.linalg.det(axes) == pytest.approx(1)
    np.testing.assert_array_equal(axes @ [0, 0, 1], [1, 0, 0])  # forward is +X
    np.testing.assert_array_equal(axes @ [1, 0, 0], [0, -1, 0])  # right is -Y
    np.testing.assert_array_equal(axes @ [0, 1, 0], [0, 0, -1])  # down is -Z
    assert rigid(world_from_camera_axes(), jnp.zeros(3)).shape == (4, 4)


def test_both_precisions_give_the_same_rays() -> None:
    pose = upright(jnp.array([1.0, 2.0, 3.0]), 0.7, -0.3)
    exact = rays_of_pose64(np.asarray(pose), 8)
    assert exact.dtype == np.float64
    np.testing.assert_allclose(rays_of_pose(pose, 8, 16), exact, atol=1e-6)  # float32 sines through one product


def test_azimuths_are_centred_and_even() -> None:
    azimuth = np.asarray(azimuths(12))
    np.testing.assert_allclose(azimuth, -azimuth[::-1], atol=1e-6)  # float32 near pi
    np.testing.assert_allclose(np.diff(azimuth), 2 * np.pi / 12, atol=1e-6)
