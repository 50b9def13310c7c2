"""The mesh baseline against planes and steps whose answer is known."""

import jax.numpy as jnp
import numpy as np
import pytest

from experiments.evaluate.mesh_warp import mesh_of, mesh_warp
from rein3d_jax.geometry.poses import equirectangular_camera, pinhole_camera, upright
from rein3d_jax.geometry.sphere import pixel_rays, rays_of_pose64
from rein3d_jax.scene import Panorama

ROWS = 64
EYE = np.array([0.3, -0.2, 0.4])


def rays(camera):
    return rays_of_pose64(np.asarray(camera.world_from_camera, np.float64), camera.height)


def panorama(distance):
    rgb = 0.5 + 0.4 * np.asarray(pixel_rays(ROWS, 2 * ROWS))  # a smooth function of the direction
    return Panorama(jnp.asarray(rgb), jnp.asarray(distance, jnp.float32), jnp.asarray(distance > 0))


def test_a_plane_is_exact(turned_pose):
    """Floor and ceiling without end: nothing is cut but the horizon, however grazing, and distances are the planes'."""
    up = rays_of_pose64(turned_pose, ROWS)[..., 2]
    mesh = mesh_warp(panorama(1.5 / np.abs(up)))
    camera = equirectangular_camera(upright(jnp.asarray(EYE)), ROWS)
    shown = mesh(camera)
    away = rays(camera)
    steep = np.abs(away[..., 2]) > 0.4  # farther out the horizon's gap lies
    assert float(shown.alpha[steep].min()) == 1
    height = np.where(away[..., 2] > 0, 1.5 - EYE[2], 1.5 + EYE[2])
    # A pixel's four rays lie around its centre: the mean of 1 / sin is off by half the curvature times (pitch / 4)^2.
    np.testing.assert_allclose(shown.distance[steep], (height / np.abs(away[..., 2]))[steep], rtol=4e-3)
    points = EYE + away * np.asarray(shown.distance)[..., None]
    wanted = 0.5 + 0.4 * points / np.linalg.norm(points, axis=-1, keepdims=True)
    np.testing.assert_allclose(shown.rgb[steep], wanted[steep], atol=5e-3)  # bilinear, and the same curvature


def test_every_link_of_a_smooth_surface_holds():
    triangles = mesh_of(np.full((ROWS, 2 * ROWS), 2.0))
    assert len(triangles) == 2 * (ROWS - 1) * 2 * ROWS + 2 * 2 * ROWS  # two a cell, and a fan at each pole
    shown = mesh_warp(panorama(np.full((ROWS, 2 * ROWS), 2.0)))(equirectangular_camera(upright(jnp.asarray(EYE)), ROWS))
    assert float(shown.alpha.min()) == 1  # closed: seam and poles too


def step(azimuth):
    """A wall at 4 m all round, a nearer one at 2 m in front: distance (ROWS, 2 ROWS)."""
    return np.where(np.abs(azimuth) < 0.5, 2.0, 4.0) * np.ones((ROWS, 1))


def test_a_step_is_cut_and_leaves_a_hole():
    azimuth = ((np.arange(2 * ROWS) + 0.5) / (2 * ROWS) - 0.5) * 2 * np.pi
    mesh = mesh_warp(panorama(step(azimuth)))
    aside = pinhole_camera(upright(jnp.array([0.0, 1.5, 0.0])), 64, np.pi / 2)  # left of the origin, looking along +X
    shown = mesh(aside)
    assert 0.05 < float((shown.alpha == 0).mean()) < 0.4
    known = np.asarray(shown.distance)[np.asarray(shown.alpha) == 1]
    points = np.asarray(aside.world_from_camera)[:3, 3]
    assert known.min() > 0.5 and known.max() < 4.0 + np.linalg.norm(points)  # between the spheres stands nothing
    lengths = np.linalg.norm(mesh.caster.anchor, axis=-1)
    assert set(np.round(lengths, 3)) == {2.0, 4.0}  # corners on either surface, none between


@pytest.mark.parametrize("wide", [1, 2, 3, 10])
def test_posts_of_any_width_stand_apart(wide):
    distance = np.full((ROWS, 2 * ROWS), 4.0)
    distance[:, 30 : 30 + wide] = 2.0
    corners = np.linalg.norm(mesh_of(distance)[ROWS // 2 :], axis=-1)
    spans = corners.max(axis=1) / corners.min(axis=1)
    away = np.abs(mesh_of(distance)[ROWS // 2 :][..., 2]).max(axis=1) < 1.9  # the poles' fans span both
    assert spans[away].max() < 1.1


def test_unknown_pixels_are_holes():
    distance = np.full((ROWS, 2 * ROWS), 2.0)
    distance[20:40, 50:80] = 0.0
    shown = mesh_warp(panorama(distance))(equirectangular_camera(upright(jnp.zeros(3)), ROWS))
    hole = np.asarray(shown.alpha) == 0
    assert hole[21:39, 51:79].all() and not hole[:18].any() and not hole[42:].any()
