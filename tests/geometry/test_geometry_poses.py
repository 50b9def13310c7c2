"""Laws of rigid poses, upright cameras and the pinhole map."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.conventions import EQUIRECTANGULAR
from rein3d_jax.geometry.pinhole import focal_from_fov, pinhole_rays, pixels_from_points
from rein3d_jax.geometry.poses import equirectangular_camera, invert, pinhole_camera, rigid, upright
from rein3d_jax.geometry.rotations import matrix_from_quats
from rein3d_jax.geometry.sphere import world_from_camera_axes

ATOL = 1e-5  # float32 products of rotations and metres


def test_inverse_undoes_a_pose() -> None:
    rotation = matrix_from_quats(jax.random.normal(jax.random.key(0), (2, 5, 4)))
    pose = rigid(rotation, jax.random.normal(jax.random.key(1), (2, 5, 3)))
    identity = np.broadcast_to(np.eye(4), (2, 5, 4, 4))
    np.testing.assert_allclose(np.asarray(invert(pose)) @ np.asarray(pose), identity, atol=ATOL)
    np.testing.assert_allclose(invert(invert(pose)), pose, atol=ATOL)


def test_upright_without_turn_is_the_panoramas_own_pose() -> None:
    position = jnp.array([1.0, 2.0, 3.0])
    np.testing.assert_allclose(upright(position), rigid(world_from_camera_axes(), position), atol=1e-7)


@pytest.mark.parametrize(("yaw", "pitch"), [(0.0, 0.0), (np.pi / 2, 0.0), (-2.0, 0.7), (3.0, -1.4)])
def test_upright_looks_left_and_up(yaw: float, pitch: float) -> None:
    pose = np.asarray(upright(jnp.zeros(3), yaw, pitch))
    forward = [np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), np.sin(pitch)]
    np.testing.assert_allclose(pose[:3, 2], forward, atol=ATOL)
    assert pose[2, 0] == 0  # the horizon is level
    assert pose[2, 1] < 0  # and down is down
    np.testing.assert_allclose(pose[:3, :3].T @ pose[:3, :3], np.eye(3), atol=ATOL)
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1, abs=ATOL)


def test_pinhole_map_inverts_and_spans_its_field_of_view() -> None:
    camera = pinhole_camera(upright(jnp.zeros(3)), 16, np.pi / 2)
    depth = 1 + jax.random.uniform(jax.random.key(2), (16, 16, 1))
    rays = pinhole_rays(16, 16, camera.focal, camera.centre)
    u, v = pixels_from_points(rays * depth, camera.focal, camera.centre)
    np.testing.assert_allclose(u, np.broadcast_to(np.arange(16) + 0.5, (16, 16)), atol=ATOL)
    np.testing.assert_allclose(v, np.broadcast_to(np.arange(16)[:, None] + 0.5, (16, 16)), atol=ATOL)
    corner = jnp.array([np.tan(np.pi / 4), 0.0, 1.0])
    assert pixels_from_points(corner, camera.focal, camera.centre)[0] == pytest.approx(16, abs=ATOL)
    assert focal_from_fov(np.pi / 2, 16) == pytest.approx(8)


def test_an_equirectangular_camera_is_twice_as_wide_as_high() -> None:
    camera = equirectangular_camera(upright(jnp.zeros(3)), 32)
    assert (camera.model, camera.width, camera.height) == (EQUIRECTANGULAR, 64, 32)
