"""Projection against Monte Carlo: the footprint's second moments are those of sampled directions."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.geometry.covariance import scaled_axes
from rein3d_jax.geometry.pinhole import pixels_from_points
from rein3d_jax.geometry.poses import equirectangular_camera, invert, pinhole_camera, upright
from rein3d_jax.rasterize import ADDED, LEAST, RasterizeConfig
from rein3d_jax.rasterize.project import project
from rein3d_jax.scene import Gaussians

LATITUDES = np.radians([0.0, 60.0, 89.0, 89.9])
SAMPLES = 40_000
run = jax.jit(project, static_argnames=("config",))


def splats_at(directions: np.ndarray, distance: float = 2.0) -> Gaussians:
    """Tilted ellipsoids whose longest sigma is a hundredth of their distance."""
    count = len(directions)
    log_scales = jnp.log(0.01 * distance * jnp.array([1.0, 0.4, 0.7]))
    quats = jax.random.normal(jax.random.key(0), (count, 4))
    axes = jnp.broadcast_to(log_scales, (count, 3))
    sh, alive = jnp.zeros((count, 1, 3)), jnp.ones(count, bool)
    return Gaussians(distance * jnp.float32(directions), axes, quats, jnp.full(count, 2.0), sh, alive)


def sampled_points(gaussians: Gaussians, world_from_camera: jax.Array) -> jax.Array:
    """(samples, n, 3) in camera axes."""
    noise = jax.random.normal(jax.random.key(1), (SAMPLES, gaussians.alive.shape[0], 3))
    world = gaussians.means + jnp.einsum("nij,snj->sni", scaled_axes(gaussians.log_scales, gaussians.quats), noise)
    pose = invert(world_from_camera)
    return jnp.einsum("ij,snj->sni", pose[:3, :3], world) + pose[:3, 3]


def second_moments(samples: np.ndarray, centre: np.ndarray) -> np.ndarray:
    offset = np.asarray(samples, np.float64) - centre
    return np.einsum("sni,snj->nij", offset, offset) / len(offset)


def covariance_of(splats) -> np.ndarray:
    """The covariance that the whitening rows stand for."""
    inverse = np.linalg.pinv(np.asarray(splats.axes, np.float64)[:, :2])
    return inverse @ np.swapaxes(inverse, 1, 2)


def close_to(actual: np.ndarray, expected: np.ndarray) -> None:
    error = np.linalg.norm(actual - expected, axis=(1, 2)) / np.linalg.norm(expected, axis=(1, 2))
    # Monte Carlo: 1 / sqrt(40 000) = 0.5 % an entry; linearising a splat of 0.01 rad is off by its square.
    assert np.all(error < 0.05), error


def at_latitudes() -> np.ndarray:
    """Directions (4, 3) at LATITUDES."""
    across, flat = 0.7 + np.arange(4), np.cos(LATITUDES)
    return np.stack([flat * np.cos(across), flat * np.sin(across), np.sin(LATITUDES)], axis=-1)


def test_a_panorama_footprint_is_the_spread_of_directions() -> None:
    """At the pole as on the horizon: a plain EWA in longitude and latitude fails there."""
    gaussians = splats_at(at_latitudes())
    camera = equirectangular_camera(upright(jnp.zeros(3), 0.2), 4096)  # sigmas of 5 pixels and more: no filter
    splats = run(gaussians, camera, config=RasterizeConfig())
    points = sampled_points(gaussians, camera.world_from_camera)
    rays = points / jnp.linalg.norm(points, axis=-1, keepdims=True)
    close_to(covariance_of(splats), second_moments(rays, np.asarray(splats.mean)))


@pytest.mark.parametrize("kind", [LEAST, ADDED])
def test_a_speck_in_a_panorama_is_as_wide_as_a_column_is_there(kind) -> None:
    gaussians = splats_at(at_latitudes())
    gaussians = gaussians.replace(log_scales=gaussians.log_scales - 12)
    camera = equirectangular_camera(upright(jnp.zeros(3)), 512)
    splats = run(gaussians, camera, config=RasterizeConfig(antialias=False, filter=kind))
    # Along rows, along columns and along the ray, in world axes as a level camera at the origin has them.
    up, ray = np.array([0.0, 0.0, 1.0]), np.asarray(at_latitudes())
    along = np.cross(up, ray) / np.linalg.norm(np.cross(up, ray), axis=-1, keepdims=True)
    pixel = RasterizeConfig.filter_variance * (np.pi / 512) ** 2
    width = np.maximum(np.cos(LATITUDES), 1 - np.cos(LATITUDES) * 512 / np.pi)  # round at the pole itself
    expected = pixel * (
        np.einsum("n,ni,nj->nij", width**2, along, along)
        + np.einsum("ni,nj->nij", np.cross(ray, along), np.cross(ray, along))
    )
    turned = np.asarray(camera.world_from_camera, np.float64)[:3, :3]
    np.testing.assert_allclose(turned @ covariance_of(splats) @ turned.T, expected, atol=1e-4 * pixel)  # float32 rays


@pytest.mark.parametrize("antialias", [True, False])
def test_antialiasing_keeps_opacity_times_area_in_a_panorama(antialias) -> None:
    """The filtered footprint is larger, so its peak is lower: splats of 1 to 2 pixels, at any latitude."""
    gaussians = splats_at(at_latitudes())
    camera = equirectangular_camera(upright(jnp.zeros(3), 0.2), 512)
    splats = run(gaussians, camera, config=RasterizeConfig(antialias=antialias, filter=ADDED))
    points = sampled_points(gaussians, camera.world_from_camera)
    moments = second_moments(points / jnp.linalg.norm(points, axis=-1, keepdims=True), np.asarray(splats.mean))
    before, after = (np.prod(np.linalg.eigvalsh(x)[:, 1:], axis=1) for x in (moments, covariance_of(splats)))
    peak = np.exp(splats.log_opacity) / jax.nn.sigmoid(2.0)
    np.testing.assert_allclose(peak, np.sqrt(before / after) if antialias else np.ones(4), rtol=0.02)  # Monte Carlo


def test_a_pinhole_footprint_is_the_spread_of_pixels() -> None:
    slopes = np.array([[0.0, 0.0], [0.3, -0.2], [-0.8, 0.1], [0.5, 0.9]])
    directions = np.stack([np.ones(4), -slopes[:, 0], -slopes[:, 1]], axis=-1)
    gaussians = splats_at(directions / np.linalg.norm(directions, axis=-1, keepdims=True))
    camera = pinhole_camera(upright(jnp.zeros(3)), 512, np.pi / 2)
    splats = run(gaussians, camera, config=RasterizeConfig())
    points = sampled_points(gaussians, camera.world_from_camera)
    pixels = jnp.stack(pixels_from_points(points, camera.focal, camera.centre), axis=-1)
    close_to(covariance_of(splats), second_moments(pixels, np.asarray(splats.mean)))  # of 1 pixel and more: no filter


def test_offsets_move_projected_means_by_pixels_and_nothing_else() -> None:
    """On the sphere by a row's pitch each, along the tangent plane."""
    gaussians = splats_at(np.array([[1.0, 0, 0], [0.8, 0.0, -0.6], [0.8, 0.48, 0.36]]))
    offsets = jnp.array([[3.0, 0.0], [0.0, -2.0], [1.5, 2.0]])
    for camera in (pinhole_camera(upright(jnp.zeros(3)), 64, 2.0), equirectangular_camera(upright(jnp.zeros(3)), 64)):
        both = (run(gaussians, camera, config=RasterizeConfig(), means2d_offset=x) for x in (0 * offsets, offsets))
        before, after = both
        moved = np.asarray(after.mean - before.mean)
        if moved.shape[1] == 2:
            np.testing.assert_allclose(moved, offsets, atol=1e-5)  # float32 pixels up to 64
        else:
            lengths = np.linalg.norm(offsets, axis=1) * np.pi / camera.height
            np.testing.assert_allclose(np.linalg.norm(moved, axis=1), lengths, atol=1e-6)  # float32 unit rays
            np.testing.assert_allclose(np.sum(moved * before.mean, axis=1), 0, atol=1e-6)
        for a, b in zip(jax.tree.leaves(before.replace(mean=0)), jax.tree.leaves(after.replace(mean=0)), strict=True):
            np.testing.assert_array_equal(a, b)
