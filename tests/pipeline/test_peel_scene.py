"""The layers behind the coarse scene, in a box room with a board in it."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import rein3d_jax as r3d
from rein3d_jax.explore.hidden import on_observed
from rein3d_jax.geometry.poses import equirectangular_camera
from rein3d_jax.geometry.sphere import pixel_rays
from rein3d_jax.pipeline.peel_scene import peel_scene
from rein3d_jax.pipeline.stages import level_pose
from rein3d_jax.pipeline.survey import room_background
from rein3d_jax.restore import restorer

HALF, ROWS, KEY = jnp.array([2.0, 1.6, 1.3]), 32, jax.random.key(0)
STAGES = r3d.Stages(
    explore=r3d.explore.ExploreConfig(trajectories=2, step=0.5), restore=r3d.restore.RestoreConfig(height=ROWS)
)


@pytest.fixture(scope="module")
def known():
    """A box room, its floor dark, with a white board halfway to the walls ahead."""
    rays = pixel_rays(ROWS, 2 * ROWS)
    distance = jnp.min(HALF / jnp.maximum(jnp.abs(rays), 1e-6), axis=-1)
    board = jnp.zeros(distance.shape, bool).at[12:22, 28:36].set(True)
    rgb = jnp.where(board[..., None], 1.0, 0.3 * jnp.ones(3))
    panorama = r3d.Panorama(rgb, jnp.where(board, distance / 2, distance), distance > 0)
    return r3d.survey(panorama, STAGES)


def peeled(known, **changes):
    stages = dataclasses.replace(STAGES, **changes)
    background = room_background(known.panorama, stages.restore)
    return peel_scene(known, background, restorer(stages.restore, background), KEY, stages=stages)


def test_what_is_new_lies_behind_what_was_seen(known):
    scene = peeled(known)
    new = scene.alive & ~r3d.lift.with_capacity(known.coarse, scene.alive.size).alive
    assert int(new.sum()) > 50
    assert not on_observed(known.panorama, scene.means)[new].any()


def test_behind_the_board_there_is_the_wall(known):
    """From beside the camera the gap behind the board's edge shows the room's own colour."""
    camera = equirectangular_camera(level_pose(jnp.array([0.0, 0.8, 0.0])), ROWS)
    before, _ = r3d.render(known.coarse, camera)
    after, _ = r3d.render(peeled(known), camera)
    gap = np.asarray(before.alpha) < 0.2
    assert gap.sum() > 10
    assert np.asarray(after.alpha)[gap].mean() > 0.9  # a layer's rim is a pixel soft
    np.testing.assert_allclose(np.median(np.asarray(after.rgb / after.alpha[..., None])[gap]), 0.3, atol=0.05)


def test_layers_that_are_not_wanted_are_not_made(known):
    scene = peeled(known, peel=r3d.peel.PeelConfig(room=False, outside=False, lining=False))
    assert all(np.array_equal(a, b) for a, b in zip(jax.tree.leaves(scene), jax.tree.leaves(known.coarse), strict=True))


def test_a_small_buffer_grows(known):
    full = known.replace(coarse=r3d.lift.compact(known.coarse))
    assert int(peeled(full).alive.sum()) == int(peeled(known).alive.sum())


def test_an_empty_room_asks_for_no_guess(known):
    rays = pixel_rays(ROWS, 2 * ROWS)
    empty = known.panorama.replace(distance=jnp.min(HALF / jnp.maximum(jnp.abs(rays), 1e-6), axis=-1))
    background = room_background(empty, STAGES.restore)
    stages = dataclasses.replace(STAGES, peel=r3d.peel.PeelConfig(lining=False))
    scene = peel_scene(known.replace(panorama=empty), background, lambda *_: 1 / 0, KEY, stages=stages)
    assert int(scene.alive.sum()) == int(known.coarse.alive.sum())
