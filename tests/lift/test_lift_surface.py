"""Laws of splats that follow their surface."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.geometry.poses import rigid
from rein3d_jax.geometry.rotations import matrix_from_quats
from rein3d_jax.geometry.sphere import pixel_rays, world_from_camera_axes
from rein3d_jax.lift import LiftConfig, lift
from rein3d_jax.lift.surface import axes_at, slopes
from rein3d_jax.scene import Panorama

HEIGHT = 64
RAYS = np.asarray(pixel_rays(HEIGHT, 2 * HEIGHT))
EVERY = jnp.ones(RAYS.shape[:2], bool)


def plane(normal, metres=1.6):
    """Distances to the plane normal . x = metres; (those, where the plane is met within 40 m)."""
    facing = RAYS @ np.asarray(normal)
    return jnp.asarray(metres / np.maximum(facing, 0.04), jnp.float32), facing > 0.06


def lifted(distance, **config):
    panorama = Panorama(jnp.full((*distance.shape, 3), 0.5), distance, EVERY)
    return lift(panorama, rigid(world_from_camera_axes(), jnp.zeros(3)), EVERY, config=LiftConfig(**config))


@pytest.mark.parametrize("normal", [(0, 0, -1), (0.6, 0, 0.8), (0.36, -0.48, 0.8)])
def test_a_plane_has_its_own_normal(normal):
    distance, met = plane(normal)
    axes, tangent, _ = axes_at(RAYS, slopes(distance, EVERY))
    # Inner pixels, and not the pole's two rows, where columns are so close that float32 distances make no slope.
    inner = met & np.roll(met, 1, 1) & np.roll(met, -1, 1) & np.roll(met, 1, 0) & np.roll(met, -1, 0)
    inner[[0, 1, -2, -1]] = False
    # Central differences of a slope that bends like a cosine err by pitch^2 / 6 of it, 4e-4; as an angle less.
    np.testing.assert_allclose(np.abs(axes[..., 2] @ jnp.array(normal))[inner], 1, atol=2e-3)
    incidence = np.sqrt(1 / (RAYS @ np.asarray(normal)) ** 2 - 1)
    # At the foot of the perpendicular slopes change sign and count as none: half a pitch, 0.025.
    np.testing.assert_allclose(tangent[inner], incidence[inner], rtol=0.03, atol=0.03)


def test_axes_are_rotations():
    rough = jnp.asarray(np.random.default_rng(0).uniform(1, 3, EVERY.shape), jnp.float32)
    axes, _, _ = axes_at(RAYS, slopes(rough, EVERY))
    np.testing.assert_allclose(jnp.swapaxes(axes, -1, -2) @ axes, np.broadcast_to(np.eye(3), axes.shape), atol=1e-5)
    np.testing.assert_allclose(jnp.linalg.det(axes), 1, atol=1e-5)


def test_a_step_has_no_slope_on_either_side():
    distance = jnp.where(jnp.arange(2 * HEIGHT) < 40, 1.0, 3.0) * jnp.ones((HEIGHT, 1))
    np.testing.assert_array_equal(slopes(distance, EVERY), 0)


def test_what_is_beside_a_hole_has_no_slope():
    distance, _ = plane((0, 0, -1))
    known = EVERY.at[50, 30].set(False)
    np.testing.assert_array_equal(slopes(distance, known)[50, 29:32, 0], 0)
    np.testing.assert_array_equal(slopes(distance, known)[49:52, 30, 1], 0)


def seen_from_the_origin(splats):
    """Covariances (n, 2, 2) in radians, towards growing columns and upward."""
    axes, scales = matrix_from_quats(splats.quats), jnp.exp(splats.log_scales)
    covariance = jnp.einsum("nik,nk,njk->nij", axes, scales**2, axes)
    away = jnp.linalg.norm(splats.means, axis=-1, keepdims=True)
    ray = splats.means / away
    right = jnp.stack([ray[:, 1], -ray[:, 0], jnp.zeros(len(ray))], axis=-1)
    right /= jnp.linalg.norm(right, axis=-1, keepdims=True)
    basis = jnp.stack([right, jnp.cross(right, ray)], axis=1) / away[..., None]
    return np.asarray(basis @ covariance @ jnp.swapaxes(basis, 1, 2))


@pytest.mark.parametrize("steepest", [2.0, 6.0])
def test_seen_from_where_it_was_lifted_a_splat_has_its_pixels_shape(steepest):
    distance, _ = plane((0.36, -0.48, 0.8))
    overlap = 0.9
    seen = seen_from_the_origin(lifted(distance, steepest=steepest, footprint=overlap, plain_footprint=overlap))
    pitch = np.pi / HEIGHT
    side = pitch * np.stack([np.hypot(RAYS[..., 0], RAYS[..., 1]).ravel(), np.ones(EVERY.size)])
    wide, high = (overlap * side) ** 2 / 2
    # Thickness adds its own square at most where the surface is seen edge-on; float32 sums of stretched axes.
    for variance, pixel in ((seen[:, 0, 0], wide), (seen[:, 1, 1], high)):
        assert np.all(variance > pixel * 0.99) and np.all(variance < pixel * (1.01 + LiftConfig.thickness**2))
    # Slivers at the poles are 40 times as high as wide: a lean of float32's angles is seen in them.
    assert np.abs(seen[:, 0, 1] / np.sqrt(wide * high)).max() < LiftConfig.thickness**2 + 0.01


def test_no_splat_is_longer_than_the_steepest_incidence_allows():
    distance, _ = plane((0, 0, -1))
    longest = np.sqrt(1 + 3.0**2)
    flat, scales = (np.exp(np.asarray(lifted(distance, steepest=x).log_scales)) for x in (0.0, 3.0))
    ratio = scales[:, 0] / flat.max(1)
    assert np.all(ratio <= longest * 1.0001) and ratio.max() > 3
    np.testing.assert_allclose(scales[:, 2], LiftConfig.thickness * flat[:, 1], rtol=1e-4)  # of a pixel's smaller side


@pytest.mark.slow
def test_gradients_through_a_flat_wall_are_finite():
    """Where the slope is 0 its direction is any."""

    def total(distance):
        return jnp.sum(axes_at(RAYS, slopes(distance, EVERY))[0])

    gradient = jax.grad(total)(2.0 * jnp.ones(EVERY.shape))
    assert np.isfinite(gradient).all()
