"""Laws of lifting: where splats stand, how large they are, and that together they cover."""

import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rein3d_jax.errors import InputError
from rein3d_jax.geometry.poses import invert, rigid, upright
from rein3d_jax.geometry.rotations import matrix_from_quats
from rein3d_jax.geometry.sphere import pixel_rays, pixels_from_rays, world_from_camera_axes
from rein3d_jax.geometry.spherical_harmonics import rgb_from_sh
from rein3d_jax.lift import LiftConfig, lift
from rein3d_jax.scene import Gaussians, Panorama

HEIGHT, WIDTH = 8, 16
ORIGIN = rigid(world_from_camera_axes(), jnp.zeros(3))
EVERY = jnp.ones((HEIGHT, WIDTH), bool)
ROUND = LiftConfig(steepest=0.0)


def panorama(seed: int = 0, height: int = HEIGHT) -> Panorama:
    rgb_key, distance_key = jax.random.split(jax.random.key(seed))
    rgb = jax.random.uniform(rgb_key, (height, 2 * height, 3))
    distance = 1 + 0.05 * jax.random.uniform(distance_key, (height, 2 * height))  # below edge_step: nothing snaps
    return Panorama(rgb, distance, jnp.ones((height, 2 * height), bool))


def test_centres_project_back_to_their_pixels() -> None:
    pano = panorama()
    splats = lift(pano, ORIGIN, EVERY, config=LiftConfig(sharpen=0.0))  # colours as they are
    u, v = pixels_from_rays(splats.means, HEIGHT, WIDTH)
    np.testing.assert_allclose(
        u.reshape(HEIGHT, WIDTH), np.broadcast_to(np.arange(WIDTH) + 0.5, EVERY.shape), atol=1e-4
    )
    np.testing.assert_allclose(v.reshape(HEIGHT, WIDTH)[:, 0], np.arange(HEIGHT) + 0.5, atol=1e-4)
    np.testing.assert_allclose(jnp.linalg.norm(splats.means, axis=-1), pano.distance.ravel(), rtol=1e-6)  # float32
    np.testing.assert_allclose(rgb_from_sh(splats.sh, splats.means), pano.rgb.reshape(-1, 3), atol=1e-6)  # float32
    assert splats.alive.all()


def test_pose_moves_the_splats_and_nothing_else() -> None:
    """Lifting from a pose = lifting at the origin, then moving: into the camera and out again."""
    pose = upright(jnp.array([1.0, -2.0, 0.5]), 0.7, 0.3)
    here, there = lift(panorama(), ORIGIN, EVERY), lift(panorama(), pose, EVERY)
    world_from_origin = np.asarray(pose) @ np.asarray(invert(ORIGIN))
    moved = np.asarray(here.means) @ world_from_origin[:3, :3].T + world_from_origin[:3, 3]
    np.testing.assert_allclose(there.means, moved, atol=1e-6)  # float32, metres near 3
    np.testing.assert_array_equal(there.log_scales, here.log_scales)
    np.testing.assert_array_equal(there.sh, here.sh)


def test_yawed_panorama_gives_a_yawed_scene() -> None:
    pano, columns = panorama(), 5
    rolled = jax.tree.map(lambda image: jnp.roll(image, columns, axis=1), pano)
    turn = -columns * 2 * np.pi / WIDTH  # columns turn right, angles left
    left = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    here, there = lift(pano, ORIGIN, EVERY), lift(rolled, ORIGIN, EVERY)

    def grid(leaf: jax.Array) -> np.ndarray:
        return np.roll(np.asarray(leaf).reshape(HEIGHT, WIDTH, -1), columns, axis=1)

    np.testing.assert_allclose(np.asarray(there.means).reshape(HEIGHT, WIDTH, 3), grid(here.means) @ left.T, atol=1e-6)
    around = [covariances(splats).reshape(HEIGHT, WIDTH, 3, 3) for splats in (here, there)]
    moved = left @ np.roll(around[0], columns, axis=1) @ left.T
    np.testing.assert_allclose(around[1], moved, atol=1e-5)  # of squares near 0.1, float32 quaternions
    np.testing.assert_array_equal(grid(here.opacity_logits), there.opacity_logits.reshape(HEIGHT, WIDTH, 1))
    np.testing.assert_allclose(grid(here.sh), there.sh.reshape(HEIGHT, WIDTH, -1), atol=1e-6)  # sums in another order


def covariances(splats: Gaussians) -> np.ndarray:
    axes, scales = matrix_from_quats(splats.quats), jnp.exp(splats.log_scales)
    return np.asarray(jnp.einsum("nik,nk,njk->nij", axes, scales**2, axes))


@pytest.mark.parametrize("factor", [0.1, 10.0])
def test_scene_scales_with_the_distance(factor: float) -> None:
    pano = panorama()
    small, large = lift(pano, ORIGIN, EVERY), lift(pano.replace(distance=factor * pano.distance), ORIGIN, EVERY)
    np.testing.assert_allclose(large.means, factor * small.means, rtol=1e-5, atol=1e-7 * factor)
    np.testing.assert_allclose(large.log_scales, small.log_scales + np.log(factor), atol=1e-5)  # float32 logs


def test_scales_follow_the_footprint() -> None:
    """Of detail: half a pixel's diagonal is 1 / footprint sigmas, along rows and along columns."""
    pano = panorama()
    sigma = np.exp(np.asarray(lift(pano, ORIGIN, EVERY, config=ROUND).log_scales)).reshape(HEIGHT, WIDTH, 3)
    per_metre = sigma / np.asarray(pano.distance)[..., None]
    latitude = (0.5 - (np.arange(HEIGHT) + 0.5) / HEIGHT) * np.pi
    tall, wide = np.pi / HEIGHT, 2 * np.pi / WIDTH * np.cos(latitude)[:, None] * np.ones(WIDTH)
    np.testing.assert_allclose(per_metre[..., 0], LiftConfig.footprint * tall / np.sqrt(2), rtol=1e-4)
    np.testing.assert_allclose(per_metre[..., 1], LiftConfig.footprint * wide / np.sqrt(2), rtol=1e-4)
    np.testing.assert_allclose(per_metre[..., 2], LiftConfig.thickness * per_metre[..., 1], rtol=1e-4)


def least_alpha(splats: Gaussians, eye: np.ndarray, rays: np.ndarray) -> float:
    """Least accumulated alpha over rays from `eye`: a splat falls off with its least distance from the ray, in
    sigmas."""
    whitening = np.swapaxes(np.asarray(matrix_from_quats(splats.quats), np.float64), 1, 2)
    whitening /= np.exp(np.asarray(splats.log_scales, np.float64))[..., None]
    middle = np.einsum("nij,nj->ni", whitening, np.asarray(splats.means, np.float64) - eye)
    along = np.einsum("nij,rj->nri", whitening, rays)
    ahead = np.sum(along * middle[:, None], axis=-1)
    away = np.sum(middle**2, axis=-1)[:, None] - ahead**2 / np.sum(along**2, axis=-1)
    alpha = LiftConfig.opacity * np.exp(-0.5 * np.maximum(away, 0)) * (ahead > 0)
    return float(np.min(1 - np.prod(1 - alpha, axis=0)))


@pytest.mark.parametrize(("plain", "horizon", "pole"), [(False, 0.88, 0.86), (True, 0.997, 0.997)])
def test_floor_has_no_holes_up_to_the_pole(plain: bool, horizon: float, pole: float) -> None:
    """At the corners of pixels; half a diagonal away four splats of detail reach 1 - (1 - 0.99 exp(-8 / 9))^4 = 0.88,
    those of a plain floor 0.997; beside the pole, where a pixel is a triangle, 0.87."""
    height = 32
    up = np.asarray(pixel_rays(height, 2 * height))[..., 2]
    below = jnp.asarray(up < -0.2)
    pano = panorama(height=height).replace(distance=jnp.asarray(1.6 / np.maximum(-up, 0.01)))
    pano = pano.replace(rgb=jnp.full_like(pano.rgb, 0.5)) if plain else pano
    lifted = lift(pano, ORIGIN, below, config=LiftConfig(snap_edges=False, leaf_step=1.0))
    splats = jax.tree.map(lambda leaf: leaf[below.ravel()], lifted)
    corner = (np.arange(20, height)[:, None] / height - 0.5) * np.pi  # between rows, between columns
    turn = np.arange(0, 2 * np.pi, np.pi / 8)
    rays = np.stack([np.cos(corner) * np.cos(turn), np.cos(corner) * np.sin(turn), -np.sin(corner) + 0 * turn], -1)
    assert least_alpha(splats, np.zeros(3), rays[4:-3].reshape(-1, 3)) > horizon
    assert least_alpha(splats, np.zeros(3), rays[-3:].reshape(-1, 3)) > pole
    assert least_alpha(splats, np.array([0.5, 0, 0]), rays[-3:].reshape(-1, 3)) > pole  # and from half a metre off


def test_only_selected_known_pixels_come_alive_and_all_is_finite() -> None:
    pano = panorama()
    valid = pano.valid.at[2, 3].set(False).at[0].set(False)
    distance = jnp.where(valid, pano.distance, 0.0)
    select = EVERY.at[:, 7].set(False)
    splats = lift(pano.replace(valid=valid, distance=distance), ORIGIN, select)
    np.testing.assert_array_equal(splats.alive, (valid & select).ravel())
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(splats))


def test_a_lifted_scene_has_the_types_of_one_that_was_read() -> None:
    """A weakly typed leaf would have the rasterizer traced and compiled once more."""
    splats = lift(panorama(0), ORIGIN, EVERY)
    assert not any(leaf.weak_type for leaf in jax.tree.leaves(splats))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**31), st.floats(1e-3, 1e3), st.floats(0, 1))
def test_any_valid_input_is_finite_with_unit_quaternions(seed: int, scale: float, share: float) -> None:
    """Depth over six orders of magnitude, wild edges and holes, pole rows included."""
    pano = panorama(seed)
    wild = scale * jnp.exp(2 * jax.random.normal(jax.random.key(seed), (HEIGHT, WIDTH)))
    valid = jax.random.uniform(jax.random.key(seed + 1), (HEIGHT, WIDTH)) < share
    splats = lift(pano.replace(distance=wild, valid=valid), ORIGIN, EVERY)
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(splats))
    np.testing.assert_allclose(jnp.linalg.norm(splats.quats, axis=-1), 1, atol=5e-7)  # a few float32 roundings
    assert splats.alive.sum() == valid.sum()


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ({"opacity": 1.0}, "opacity must be in (0, 1), not 1.0"),  # its logit is infinite
        ({"thickness": 0.0}, "thickness must be in (0, inf), not 0.0"),  # so is its logarithm
        ({"footprint": 0.0}, "footprint must be in (0, inf), not 0.0"),
        ({"share": 0.0}, "share must be in (0, 1], not 0.0"),
        ({"max_leaf_side": 0}, "max_leaf_side must be in [1, inf), not 0"),
    ],
)
def test_settings_without_a_finite_splat_are_refused(bad: dict, message: str) -> None:
    with pytest.raises(InputError, match=re.escape(message)):
        LiftConfig(**bad)
