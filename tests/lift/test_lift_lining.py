"""The lining: behind what is sharp, and nowhere else; it closes what a close look finds open."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.explore.hidden import relative_distance
from rein3d_jax.geometry.poses import pinhole_camera, upright
from rein3d_jax.geometry.sphere import pixel_rays
from rein3d_jax.lift import LiftConfig, lift, lining
from rein3d_jax.pipeline.stages import origin_pose
from rein3d_jax.rasterize import render
from rein3d_jax.scene import Panorama

ROWS, CONFIG = 64, LiftConfig()
PITCH = np.pi / ROWS


def cube(rows: int = ROWS, *, board: bool = False) -> Panorama:
    """A cube of 4 m, seen from its middle, its walls of random colours; with a board at half the way ahead."""
    rays = pixel_rays(rows, 2 * rows)
    distance = 2 / jnp.max(jnp.abs(rays), axis=-1)
    if board:
        distance = jnp.where((rays[..., 0] > 0.9) & (rays[..., 2] > 0), distance / 2, distance)
    return Panorama(jax.random.uniform(jax.random.key(0), (*distance.shape, 3)), distance, distance > 0)


@pytest.fixture(scope="module")
def lined():
    return lining(cube(), origin_pose(), config=CONFIG)


def places(scene):
    return np.asarray(scene.means)[np.asarray(scene.alive)]


def test_it_lies_right_behind_the_surface(lined):
    """By two pixels where the wall faces the camera, and twice that at the 45 degrees of the cube's edges."""
    over = relative_distance(cube(1024), places(lined)) - 1  # of a fine one: a pixel of 64 rows is not one distance
    # 2 % of the distance for a splat's middle, which is its pixels' mean along both axes
    assert over.min() > 2 * PITCH - 0.02 and over.max() < 4 * PITCH + 0.02
    assert lined.alive.mean() > 0.5


def test_a_plain_room_has_none():
    plain = cube().replace(rgb=jnp.full((ROWS, 2 * ROWS, 3), 0.5))
    assert not lining(plain, origin_pose(), config=CONFIG).alive.any()


def test_it_keeps_away_from_steps():
    """Three pixels on either side of the board's edge at 25.8 degrees, less half of one that both are off."""
    board = places(lining(cube(board=True), origin_pose(), config=CONFIG))
    rays = board / np.linalg.norm(board, axis=1, keepdims=True)
    level = (rays[:, 2] > 0.1) & (rays[:, 2] < 0.3) & (rays[:, 0] > 0)
    assert level.sum() > 20
    assert np.abs(np.arccos(rays[level, 0]) - np.arccos(0.9)).min() > 2 * PITCH


def test_what_is_seen_at_a_slant_has_none():
    """A floor and a ceiling without end, 1 m away, to where they are seen at 45 degrees: 1 m from the nadir, and four
    pixels' more, since the lining lies behind."""
    rays = pixel_rays(ROWS, 2 * ROWS)
    floors = cube().replace(distance=1 / jnp.abs(rays[..., 2]))
    away = np.linalg.norm(places(lining(floors, origin_pose(), config=CONFIG))[:, :2], axis=1)
    assert 0.8 < away.max() < 1 + 8 * PITCH


def test_a_close_look_finds_no_gaps():
    """A tenth of a wall fills the picture: over white and over black it is the same."""
    room, pose = cube(), origin_pose()
    sharp = lift(room, pose, room.valid, config=CONFIG)
    behind = lining(room, pose, config=CONFIG)
    both = jax.tree.map(lambda *x: jnp.concatenate(x), sharp, behind)
    camera = pinhole_camera(upright(jnp.array([1.2, 0.0, 0.0])), 96, 0.5)
    least = [float(np.percentile(render(scene, camera)[0].alpha, 1)) for scene in (sharp, both)]
    assert least[0] < 0.9 and least[1] > 0.97


def test_a_yaw_by_whole_pixels_yaws_it(lined):
    """By two of the panorama's, which are one of the lining's: its splats move on by one."""
    room = cube()
    rolled = lining(jax.tree.map(lambda x: jnp.roll(x, 2, axis=1), room), origin_pose(), config=CONFIG)
    one = np.roll(np.asarray(lined.alive).reshape(ROWS // 2, ROWS), 1, axis=1)
    np.testing.assert_array_equal(np.asarray(rolled.alive).reshape(ROWS // 2, ROWS), one)


def test_it_exports_for_accelerators():
    """As one program, which gives the same as its two do here."""
    room = cube()
    exported = jax.export.export(
        jax.jit(lambda room: lining(room, origin_pose(), config=CONFIG)), platforms=["cpu", "cuda", "tpu"]
    )(room)
    for one, two in zip(
        jax.tree.leaves(exported.call(room)), jax.tree.leaves(lining(room, origin_pose(), config=CONFIG)), strict=True
    ):
        np.testing.assert_allclose(one, two, atol=1e-5)  # float32 rounding in another order
