"""Pairs of clips: where the frames stand, that both clips show the same place, and what is drawn again or refused."""

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.evaluate.metrics import psnr
from rein3d_jax.geometry.poses import upright
from rein3d_jax.geometry.shell import RoomShell, meet_shell
from rein3d_jax.geometry.sphere import rays_of_pose
from rein3d_jax.pipeline import pairs
from rein3d_jax.pipeline.pairs import Drawn, PairConfig, degrade, make_pair, pair_buffers, room_pair, scene_pair
from rein3d_jax.rasterize import Buffers
from rein3d_jax.rooms.config import RoomConfig
from rein3d_jax.scene import Panorama

pytestmark = pytest.mark.slow  # rooms traced and degraded

ROOMS = RoomConfig(boxes=16, cylinders=8, ellipsoids=8, furnished=0.3)
CONFIG = PairConfig(height=16, frames=3, speed=4.0, rooms=ROOMS)  # 0.8 m


@partial(jax.jit, static_argnums=(1, 2, 3))
def hall(pose, rows, length=4.0, width=3.0):
    """A room of `length` x `width` x 2.6 m with a checkered shell, traced without any of the project's rooms."""
    half = length / 2
    shell = RoomShell(jnp.zeros(()), jnp.array([half, width / 2, half, width / 2]), jnp.float32(1.6), jnp.float32(1.0))
    rays = rays_of_pose(pose, rows, 2 * rows)
    distance, _ = meet_shell(shell, pose[:3, 3], rays)
    points = pose[:3, 3] + rays * distance[..., None]
    return 0.5 + 0.4 * jnp.sin(2 * points), distance


@pytest.fixture(scope="module")
def drawn():
    return make_pair(jax.random.key(5), CONFIG)


@pytest.fixture(scope="module")
def traced():
    return scene_pair(jax.random.key(0), hall, CONFIG)


@pytest.fixture
def pair(request):
    """The pair of either source."""
    return request.getfixturevalue(request.param).pair


of_both = pytest.mark.parametrize("pair", ["drawn", "traced"], indirect=True)


@of_both
def test_frames_stand_on_a_straight_level_path_from_the_origin(pair):
    poses = np.asarray(pair.clean.world_from_camera)
    np.testing.assert_array_equal(poses, pair.degraded.world_from_camera)
    np.testing.assert_array_equal(poses[:, :3, :3], np.broadcast_to(upright(jnp.zeros(3))[:3, :3], (3, 3, 3)))
    steps = np.diff(poses[:, :3, 3], axis=0)
    np.testing.assert_array_equal(poses[0, :3, 3], 0)
    np.testing.assert_allclose(steps, steps[:1].repeat(2, axis=0), atol=1e-6)  # float32 of a metre
    assert np.linalg.norm(steps[0]) == pytest.approx(4.0 / 10, abs=1e-6) and abs(steps[0, 2]) < 1e-6


@of_both
def test_both_clips_show_the_same_place(pair):
    clean, degraded = pair.clean, pair.degraded
    assert float(clean.alpha.min()) == 1 and bool((clean.distance > 0).all())
    assert bool((degraded.distance > 0)[degraded.alpha > 0].all())
    np.testing.assert_array_equal(degraded.distance[degraded.alpha == 0], 0)
    seen = degraded.alpha > 0.8  # narrow splats, of pixels with detail, cover 0.84 of a pixel of their own size
    assert float(seen[0].mean()) > 0.95 and float(seen.mean()) > 0.7
    # Frame 0 is what was lifted; 16 rows are coarse, the splats overlap: a blur, no shift.
    assert float(psnr(degraded.rgb[0], clean.rgb[0])) > 20
    ratio = jnp.where(seen, degraded.distance / clean.distance, jnp.nan)
    assert abs(float(jnp.nanmedian(ratio)) - 1) < 0.06  # a splat is 11 degrees wide: what it covers is not all as far


def test_a_key_is_a_pair_and_the_path_is_free(drawn):
    again = make_pair(jax.random.key(5), CONFIG)
    for one, two in zip(jax.tree.leaves(drawn), jax.tree.leaves(again), strict=True):
        np.testing.assert_array_equal(one, two)
    other = make_pair(jax.random.key(6), CONFIG).pair
    assert float(jnp.abs(other.clean.rgb - drawn.pair.clean.rgb).mean()) > 0.01
    assert float(drawn.length) >= CONFIG.length and int(drawn.draws) >= 1
    # The band that the path was found by is one row of 64 high there; the camera keeps the clearance to all in it.
    band = drawn.pair.clean.distance[:, 7:9]
    assert float(band.min()) > CONFIG.explore.clearance - 0.05


def test_buffers_grow_until_nothing_is_dropped(drawn, monkeypatch):
    calls = []

    def small(config):
        calls.append(config)
        return Buffers(visible=512, rows=64, pairs=64, chunks=64)

    pose = drawn.pair.clean.world_from_camera
    source = Panorama(drawn.pair.clean.rgb[0], drawn.pair.clean.distance[0], jnp.ones((16, 32), bool))  # as lifted
    whole = degrade(source, pose, config=CONFIG)
    monkeypatch.setattr(pairs, "pair_buffers", small)
    grown = degrade(source, pose, config=CONFIG)
    assert calls
    np.testing.assert_allclose(grown.rgb, whole.rgb, atol=1e-5)  # sums over other buffers round otherwise
    np.testing.assert_allclose(whole.alpha, drawn.pair.degraded.alpha, atol=1e-5)  # and it is what the pair holds


def test_pairs_can_be_made_on_an_accelerator():
    keys = jax.random.split(jax.random.key(0), 2)
    batch = jax.jit(jax.vmap(lambda key: room_pair(key, CONFIG, pair_buffers(CONFIG))))
    exported = jax.export.export(batch, platforms=("cuda", "tpu"))(keys)
    shapes = {(2, 3, 16, 32, 3), (2, 3, 16, 32), (2, 3, 4, 4), (2,), (2, 4)}
    assert {aval.shape for aval in exported.out_avals} == shapes


def test_a_path_that_no_room_has_is_refused(monkeypatch):
    short = Drawn(None, jnp.float32(2.5), jnp.int32(pairs.ATTEMPTS), jnp.zeros(4))
    monkeypatch.setattr(pairs, "_room_pair", lambda key, config, buffers: short)
    with pytest.raises(InputError, match=r"none of 200 rooms has a straight path of 4 m .* the last is 2\.50 m"):
        make_pair(jax.random.key(0), dataclasses.replace(CONFIG, speed=20.0))


@pytest.mark.parametrize("length", [0.5, 1.2])  # 0.5: a path of no length
def test_a_scene_without_a_path_is_refused(length):
    with pytest.raises(InputError, match=r"longest straight path through its origin has 0\.\d\d m"):
        scene_pair(
            jax.random.key(0),
            lambda pose, rows: hall(pose, rows, length, length),
            dataclasses.replace(CONFIG, speed=20.0),
        )


def test_a_clip_lies_within_the_path_and_goes_either_way():
    path = pairs.Chord(jnp.array([-2.0, 0, 0]), jnp.array([1.0, 0, 0]), jnp.float32(5.0))
    ends = []
    for seed in range(20):
        offsets, start = pairs.clip_places(jax.random.key(seed), path, CONFIG)
        places = start + offsets
        assert float(places[:, 0].min()) >= -2 - 1e-6 and float(places[:, 0].max()) <= 3 + 1e-6
        ends.append(float(offsets[-1, 0]))
    assert {round(x, 3) for x in ends} == {0.8, -0.8}


def test_buffers_are_a_function_of_the_config():
    assert pair_buffers(CONFIG) == pair_buffers(CONFIG) and min(pair_buffers(CONFIG)) > 0
