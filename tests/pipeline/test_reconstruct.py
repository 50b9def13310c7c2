"""The whole pipeline as a pure function: a box room that one panorama shows, on a tiny size."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import rein3d_jax as r3d
from rein3d_jax.depth.estimate import DepthConfig
from rein3d_jax.depth.room_shell import RoomShellConfig
from rein3d_jax.geometry.sphere import pixel_rays
from rein3d_jax.pipeline.peel_scene import peel_scene
from rein3d_jax.pipeline.survey import room_background
from rein3d_jax.restore import restorer

pytestmark = pytest.mark.slow  # the whole pipeline

HALF = jnp.array([2.0, 1.6, 1.3])  # metres: half sizes of the room
HEIGHT, KEY = 64, jax.random.key(0)
STAGES = r3d.Stages(
    shell=RoomShellConfig(climbers=32, rounds=4),
    explore=r3d.explore.ExploreConfig(trajectories=2, step=0.5),
    restore=r3d.restore.RestoreConfig(height=HEIGHT),
    refine=r3d.refine.RefineConfig(
        steps=2, batch=1, sh_degree=0, evaluate_every=1, densification="none", views=r3d.refine.ViewsConfig(size=16)
    ),
)


@pytest.fixture(scope="module")
def panorama() -> r3d.Panorama:
    rays = pixel_rays(HEIGHT, 2 * HEIGHT)
    distance = jnp.min(HALF / jnp.maximum(jnp.abs(rays), 1e-6), axis=-1)
    rgb = 0.5 + 0.4 * jnp.sin(3 * rays * distance[..., None])
    return r3d.Panorama(rgb, distance, distance > 0)


@pytest.fixture(scope="module")
def result(panorama) -> r3d.Reconstruction:
    return r3d.reconstruct(panorama, KEY, stages=STAGES)


@pytest.fixture(scope="module")
def explore(panorama):
    """(start=state) -> the states after each path from there: the generators, as a caller who watches them would."""
    known = r3d.survey(panorama, STAGES)
    background = room_background(panorama, STAGES.restore)
    fill = restorer(STAGES.restore, background, None)
    key, peel_key = (jax.random.fold_in(KEY, i) for i in (0, 2))
    peeled = known.replace(coarse=peel_scene(known, background, fill, peel_key, stages=STAGES))
    return lambda **start: list(r3d.explore_and_restore(peeled, fill, key, stages=STAGES, **start))


@pytest.fixture(scope="module")
def explored(explore) -> list:
    return explore()


@pytest.fixture(scope="module")
def refined(panorama, explored):
    """stages -> the last snapshot of refining what was explored."""
    start, key = explored[-1].scene, jax.random.fold_in(KEY, 1)
    views = r3d.collect_views(panorama, [state.video for state in explored], stages=STAGES)

    def last(stages):
        for snapshot in r3d.refine_scene(start, views, panorama, key, stages=stages):
            assert snapshot.step <= stages.refine.steps
        return snapshot

    return last


def same_bytes(one, other) -> bool:
    pairs = zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True)
    return all(np.asarray(a).tobytes() == np.asarray(b).tobytes() for a, b in pairs)


def test_it_gives_a_scene_and_how_it_came_about(panorama, result) -> None:
    assert len(result.videos) == len(result.decisions.revealed) == 2
    assert result.decisions.explored == "all paths taken" and result.decisions.refined == "all steps taken"
    assert result.curves.loss[:, 0].tolist() == [1, 2] and result.curves.psnr[:, 0].tolist() == [0, 1, 2]
    assert int(result.coarse.alive.sum()) == panorama.distance.size <= int(result.scene.alive.sum())
    camera = r3d.equirectangular_camera(r3d.upright(jnp.zeros(3)), HEIGHT)
    frame, _ = r3d.render(result.scene, camera)
    error = jnp.abs(jnp.where(frame.distance > 0, frame.distance, jnp.nan) - panorama.distance)
    assert float(jnp.nanmedian(error)) < 0.05  # metres: half a pixel's width on the walls


def test_what_is_known_everywhere_stays_as_it_is(panorama, result) -> None:
    np.testing.assert_array_equal(result.panorama.distance, panorama.distance)


def test_it_repeats_to_the_byte_and_its_stages_joined_by_hand_give_the_same(explore, explored, refined, result) -> None:
    (again,) = explore(start=explored[0])
    assert same_bytes(again, explored[1])  # on from a saved state
    assert same_bytes(refined(STAGES).scene, result.scene)


def test_a_limit_on_the_count_holds(refined) -> None:
    small = dataclasses.replace(STAGES, refine=dataclasses.replace(STAGES.refine, max_count=1000, steps=1))
    assert int(refined(small).scene.alive.sum()) == 1000


def test_without_a_known_distance_a_box_is_fitted(panorama) -> None:
    unknown = panorama.replace(valid=jnp.zeros_like(panorama.valid))
    placed, fitted = r3d.with_distance(unknown, dataclasses.replace(STAGES, depth=DepthConfig(method="shell")))
    assert fitted and bool(placed.valid.all()) and float(placed.distance.min()) > 0
    assert not r3d.with_distance(panorama, STAGES)[1]


def test_a_network_s_estimate_is_metres_by_the_camera_s_height(panorama) -> None:
    """Twice the height, twice all distances."""
    stages = dataclasses.replace(STAGES, depth=DepthConfig(method="network"))
    unknown, network = panorama.replace(valid=jnp.zeros_like(panorama.valid)), r3d.read_depth_network()
    low, high = (r3d.with_distance(unknown, stages, network, camera_height=height)[0] for height in (1.2, 2.4))
    assert bool(jnp.isfinite(low.distance).all()) and float(low.distance.min()) > 0
    np.testing.assert_allclose(high.distance, 2 * low.distance, rtol=1e-5)  # float32
    with pytest.raises(r3d.InputError, match="read_depth_network"):
        r3d.with_distance(unknown, stages)


def test_where_no_path_was_restored_nothing_is_refined(panorama):
    explore = dataclasses.replace(STAGES.explore, min_revealed=0.99)
    stages = dataclasses.replace(STAGES, explore=explore, peel=r3d.peel.PeelConfig(lining=False))
    result = r3d.reconstruct(panorama, KEY, stages=stages)
    assert all(len(video.rgb) == 1 for video in result.videos)
    assert len(result.curves.loss) == len(result.curves.psnr) == 0
    assert int(result.scene.alive.sum()) == int(result.coarse.alive.sum())  # an empty room: nothing is hidden
