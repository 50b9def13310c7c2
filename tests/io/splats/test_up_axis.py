"""A rotated scene looks the same from the rotated place: means, orientations and spherical harmonics go together."""

import numpy as np
import plyfile
import pytest

from rein3d_jax.geometry.covariance import scaled_axes
from rein3d_jax.geometry.rotations import matrix_from_quats
from rein3d_jax.geometry.spherical_harmonics import rgb_from_sh
from rein3d_jax.io.splats.gaussian_file import write_splats
from rein3d_jax.io.splats.up_axis import UP_AXES, rotated_scene, sh_rotation, with_up
from rein3d_jax.scene import Gaussians

ATOL = 2e-5  # float32 through a least-squares solution of 64 rays


def scene(degree, count=20):
    rng = np.random.default_rng(degree)
    normal = lambda *shape: rng.standard_normal((count, *shape)).astype(np.float32)  # noqa: E731
    quats = normal(4)
    quats /= np.linalg.norm(quats, axis=1, keepdims=True)
    return Gaussians(normal(3), normal(3), quats, normal(), normal((degree + 1) ** 2, 3), np.ones(count, bool))


def any_rotation(seed):
    return np.asarray(matrix_from_quats(np.random.default_rng(seed).standard_normal(4).astype(np.float32)), np.float64)


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
@pytest.mark.parametrize("rotation", [any_rotation(1), UP_AXES["y"][0], UP_AXES["y-down"][0]], ids=["any", "y", "down"])
def test_every_ray_keeps_its_colour_and_every_splat_its_shape(degree, rotation):
    before, after = scene(degree), rotated_scene(scene(degree), rotation)
    rays = np.random.default_rng(5).standard_normal((20, 3)).astype(np.float32)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    seen, again = rgb_from_sh(before.sh, rays), rgb_from_sh(after.sh, (rays @ rotation.T).astype(np.float32))
    np.testing.assert_allclose(again, seen, atol=ATOL)
    np.testing.assert_allclose(after.means, before.means @ rotation.T, atol=1e-6)  # float32
    axes = [np.asarray(scaled_axes(g.log_scales, g.quats), np.float64) for g in (before, after)]
    old, new = (a @ a.swapaxes(1, 2) for a in axes)  # covariances
    np.testing.assert_allclose(new, rotation @ old @ rotation.T, rtol=1e-5, atol=1e-4 * np.abs(old).max())  # exp(6)


def test_rotating_harmonics_is_a_homomorphism_and_orthogonal():
    a, b = any_rotation(1), any_rotation(2)
    np.testing.assert_allclose(sh_rotation(a @ b, 16), sh_rotation(a, 16) @ sh_rotation(b, 16), atol=ATOL)
    np.testing.assert_allclose(sh_rotation(a, 16) @ sh_rotation(a, 16).T, np.eye(16), atol=ATOL)


def test_the_axes_are_what_they_are_called():
    up = np.array([[0, 0, 1.0]])
    assert (up @ UP_AXES["y"][0].T == [[0, 1, 0]]).all() and (up @ UP_AXES["y-down"][0].T == [[0, -1, 0]]).all()
    for rotation, _ in UP_AXES.values():
        assert np.linalg.det(rotation) == 1  # nothing is mirrored
    same = scene(1)
    assert with_up(same, "z") is same


@pytest.mark.parametrize(("up", "words"), [("z", "Z up"), ("y", "Y up"), ("y-down", "Y down")])
def test_a_ply_names_its_axes(tmp_path, up, words):
    write_splats(tmp_path / "x.ply", scene(1), antialias=True, up=up)
    ply = plyfile.PlyData.read(tmp_path / "x.ply")
    assert ply.comments == [f"{words}, metres, right-handed", "SplatRenderMode: mip"]
    np.testing.assert_array_equal(ply["vertex"]["y"], with_up(scene(1), up).means[:, 1])
