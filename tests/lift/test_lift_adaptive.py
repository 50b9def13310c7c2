"""Laws of the adaptive lift: never more Gaussians than asked for, none across a step, and together they cover."""

from dataclasses import replace

import jax
import jax.export
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.geometry.poses import equirectangular_camera, rigid, upright
from rein3d_jax.geometry.rotations import matrix_from_quats
from rein3d_jax.geometry.sphere import pixel_rays, world_from_camera_axes
from rein3d_jax.lift import LiftConfig, lift, lift_adaptively
from rein3d_jax.rasterize import RasterizeConfig, render
from rein3d_jax.scene import Panorama

HEIGHT, WIDTH = 32, 64
ORIGIN = rigid(world_from_camera_axes(), jnp.zeros(3))
EVERY = jnp.ones((HEIGHT, WIDTH), bool)
RAYS = pixel_rays(HEIGHT, WIDTH)
PATCH = EVERY.at[:, 16:].set(False).at[:8].set(False).at[24:].set(False)  # 16 x 16 pixels about the horizon
CONFIG = LiftConfig(share=0.25, max_leaf_side=4)


def box(seed: int = 0, size=(3.0, 2.5, 1.5)) -> Panorama:
    """A room of one colour, with noise in a part of it."""
    distance = jnp.min(jnp.asarray(size) / jnp.maximum(jnp.abs(RAYS), 1e-6), axis=-1)
    noise = jax.random.uniform(jax.random.key(seed), (HEIGHT, WIDTH, 3))
    return Panorama(jnp.where(PATCH[..., None], noise, 0.6), distance, EVERY)


def ball(metres: float = 2.0) -> Panorama:
    return Panorama(jnp.full((HEIGHT, WIDTH, 3), 0.6), jnp.full((HEIGHT, WIDTH), metres), EVERY)


def covariances(splats):
    turn, scales = matrix_from_quats(splats.quats), jnp.exp(splats.log_scales)
    return jnp.einsum("nik,nk,njk->nij", turn, scales**2, turn)


def shown(splats):
    frame, _ = render(splats, equirectangular_camera(ORIGIN, HEIGHT), config=RasterizeConfig())
    return frame


@pytest.mark.parametrize("share", [0.1, 0.25, 0.6])
@pytest.mark.parametrize("seed", [0, 1])
def test_never_more_than_the_share(share, seed):
    splats = lift_adaptively(box(seed), ORIGIN, EVERY, config=replace(CONFIG, share=share))
    assert splats.alive.shape == (int(share * HEIGHT * WIDTH),)
    assert 0 < splats.alive.sum() <= share * HEIGHT * WIDTH


def test_a_gaussian_has_to_be_worth_it():
    """Dearer Gaussians are fewer."""
    counts = [
        int(lift_adaptively(box(), ORIGIN, EVERY, config=replace(CONFIG, share=0.6, worth=worth)).alive.sum())
        for worth in (0.0, 0.01, 0.1, 1.0)
    ]
    assert counts == sorted(counts, reverse=True)
    assert counts[0] > counts[1] > counts[3]  # the plain walls' first, then the noise's


def test_share_one_is_one_for_each_pixel():
    whole, each = lift_adaptively(box(), ORIGIN, EVERY, config=LiftConfig()), lift(box(), ORIGIN, EVERY)
    jax.tree.map(np.testing.assert_array_equal, whole, each)


@pytest.mark.slow
def test_leaves_of_one_pixel_are_its_splats():
    """Where nothing may be joined, what the leaves' formulas give is `lift`'s splat."""
    config = LiftConfig(share=0.99, max_leaf_side=4, flatness=0.0)  # nothing is flat enough
    select = EVERY.at[:, :1].set(False)  # a share of 0.99 does not hold these, but all the others
    ours, each = lift_adaptively(box(), ORIGIN, select, config=config), lift(box(), ORIGIN, select)
    each, ours = (jax.tree.map(lambda x, g=g: x[g.alive], g) for g in (each, ours))
    np.testing.assert_allclose(ours.means, each.means, rtol=1e-5, atol=1e-5)  # float32, once inverted
    np.testing.assert_allclose(covariances(ours), covariances(each), rtol=1e-3, atol=1e-5)  # squares of 0.2 m
    np.testing.assert_allclose(ours.sh, each.sh, atol=1e-6)


@pytest.mark.slow
def test_a_smooth_room_needs_few():
    splats = lift_adaptively(ball(), ORIGIN, EVERY, config=replace(CONFIG, share=0.0625))
    frame = shown(splats)
    assert splats.alive.sum() <= HEIGHT * WIDTH / 16
    # Corners of four leaves: each sigma 0.6 of a side away by 0.7 of it gives alpha 0.5, together above 0.9.
    assert frame.alpha.min() > 0.9
    np.testing.assert_allclose(frame.rgb / frame.alpha[..., None], 0.6, atol=1e-4)  # one colour, float32 sums


def test_noise_gets_the_pixels():
    room = box().replace(distance=ball().distance)  # nothing but the picture asks for small ones
    splats = lift_adaptively(room, ORIGIN, EVERY, config=CONFIG)
    rays = splats.means / jnp.linalg.norm(splats.means, axis=-1, keepdims=True)
    nearest = jnp.argmax(rays @ RAYS.reshape(-1, 3).T, axis=-1)[splats.alive]
    # An eighth of the pixels; with leaves all alike it would hold an eighth of the Gaussians.
    assert PATCH.ravel()[nearest].mean() > 0.4


def test_none_straddles_a_step():
    near = (jnp.arange(WIDTH) > 20) & (jnp.arange(WIDTH) < 43)
    room = ball().replace(distance=jnp.where(near, 1.0, 3.0) * jnp.ones((HEIGHT, 1)))
    splats = lift_adaptively(room, ORIGIN, EVERY, config=replace(CONFIG, share=0.4))
    away = np.linalg.norm(np.asarray(splats.means), axis=-1)[splats.alive]
    assert np.all(np.minimum(np.abs(away - 1), np.abs(away - 3)) < 0.1)  # a leaf of 4 pixels on a ball bulges by 0.02


@pytest.mark.slow
def test_seen_from_where_it_was_lifted_a_leaf_lies_along_rows_and_columns():
    splats = lift_adaptively(box(), ORIGIN, EVERY, config=replace(CONFIG, share=0.5, flatness=0.02))
    ray = splats.means / jnp.linalg.norm(splats.means, axis=-1, keepdims=True)
    right = jnp.stack([ray[:, 1], -ray[:, 0], jnp.zeros(len(ray))], axis=-1)
    right /= jnp.maximum(jnp.linalg.norm(right, axis=-1, keepdims=True), 1e-6)
    basis = jnp.stack([right, jnp.cross(right, ray)], axis=1)
    seen = np.asarray(basis @ covariances(splats) @ jnp.swapaxes(basis, 1, 2))[splats.alive]
    lean = np.abs(seen[:, 0, 1]) / np.sqrt(seen[:, 0, 0] * seen[:, 1, 1])
    assert lean.max() < CONFIG.thickness**2  # what the thickness adds; a leaf askew has up to 1
    assert (np.abs(np.log(seen[:, 0, 0] / seen[:, 1, 1])) > 1).any()  # some are long


def test_everything_scales_with_distance():
    room = box()
    here = lift_adaptively(room, ORIGIN, EVERY, config=CONFIG)
    there = lift_adaptively(room.replace(distance=2 * room.distance), ORIGIN, EVERY, config=CONFIG)
    np.testing.assert_allclose(there.means[here.alive], 2 * here.means[here.alive], rtol=1e-5)  # doubling is exact
    factor = (there.log_scales - here.log_scales)[here.alive]
    np.testing.assert_allclose(factor, np.log(2), atol=1e-5)


def test_a_panorama_turned_by_the_largest_leaf_gives_a_turned_scene():
    room, columns = box(), CONFIG.max_leaf_side
    rolled = jax.tree.map(lambda image: jnp.roll(image, columns, axis=1), room)
    turn = -columns * 2 * np.pi / WIDTH  # columns turn right, angles left
    left = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    here, there = (lift_adaptively(x, ORIGIN, EVERY, config=CONFIG) for x in (room, rolled))
    assert here.alive.sum() == there.alive.sum()
    moved = np.asarray(here.means)[here.alive] @ left.T
    distances = np.linalg.norm(moved[:, None] - np.asarray(there.means)[there.alive][None], axis=-1)
    assert distances.min(axis=1).max() < 1e-4  # another order; float32, metres near 3


def test_a_pose_moves_them_and_nothing_else():
    pose = upright(jnp.array([1.0, -2.0, 0.5]), 0.7, 0.3)
    here, there = (lift_adaptively(box(), place, EVERY, config=CONFIG) for place in (ORIGIN, pose))
    world = np.asarray(pose) @ np.linalg.inv(np.asarray(ORIGIN))
    moved = np.asarray(here.means) @ world[:3, :3].T + world[:3, 3]
    np.testing.assert_allclose(np.asarray(there.means)[here.alive], moved[here.alive], atol=1e-5)  # float32, metres
    np.testing.assert_array_equal(there.log_scales, here.log_scales)


def test_what_is_selected_is_covered_and_nothing_else():
    select = EVERY.at[8:24, 20:41].set(False)
    known = EVERY.at[2:5, 50:53].set(False)
    room = box().replace(valid=known)
    splats = lift_adaptively(room, ORIGIN, select, config=replace(CONFIG, share=0.5))
    alpha = np.asarray(shown(splats).alpha)
    wanted = np.asarray(select & known)
    # Beside the hole splats are narrow: of a sigma^2 of 0.75^2 / 2 pixels a filter of 0.1 leaves 0.99 * 0.28 / 0.38.
    assert alpha[wanted].min() > 0.73
    assert alpha[12:20, 26:35].max() < 0.01  # five pixels inside the hole
    assert all(np.isfinite(x).all() for x in jax.tree.leaves(splats))


@pytest.mark.slow
def test_rooms_side_by_side():
    rooms = jax.tree.map(lambda *x: jnp.stack(x), box(0), box(1))
    both = jax.vmap(lambda room: lift_adaptively(room, ORIGIN, EVERY, config=CONFIG))(rooms)
    one = lift_adaptively(box(1), ORIGIN, EVERY, config=CONFIG)
    jax.tree.map(lambda x, y: np.testing.assert_allclose(x[1], y, atol=1e-5), both, one)  # float32, other order of sums


def test_shares_that_cannot_be_met_are_refused():
    with pytest.raises(InputError, match=r"lift\.share 0\.01 is 20 Gaussians"):
        lift_adaptively(box(), ORIGIN, EVERY, config=replace(CONFIG, share=0.01))


def test_it_lowers_for_accelerators():
    def lifted(room):
        return lift_adaptively(room, ORIGIN, EVERY, config=CONFIG).means

    exported = jax.export.export(jax.jit(lifted), platforms=["cuda", "tpu"])(box())
    assert exported.out_avals[0].shape == (int(CONFIG.share * HEIGHT * WIDTH), 3)
