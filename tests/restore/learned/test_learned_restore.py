"""Laws of the learned restorer: what was observed stays, every frame comes back finite, and one step draws nothing."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.geometry.poses import upright
from rein3d_jax.geometry.shell import RoomShell, meet_shell
from rein3d_jax.geometry.sphere import pixel_rays
from rein3d_jax.restore import RestoreConfig, background_of, restorer
from rein3d_jax.restore.blend import TRUSTED
from rein3d_jax.restore.learned.candidates import clip_of, positions
from rein3d_jax.restore.learned.condition import CANDIDATES
from rein3d_jax.restore.learned.config import NetworkConfig
from rein3d_jax.restore.learned.network import initial_parameters
from rein3d_jax.restore.learned.restore import Learned, restore_learned
from rein3d_jax.scene import Panorama, Video

ROWS, OBSERVED, KEY = 16, 0.5, jax.random.key(0)
SHELL = RoomShell(jnp.float32(0.3), jnp.array([2.5, 2.0, 1.8, 3.0]), jnp.float32(1.6), jnp.float32(1.1))
POSES = jax.vmap(lambda along: upright(along * jnp.array([0.3, 0.2, 0.05]), 0.7))(jnp.arange(5.0))
CONFIG = NetworkConfig(rows=ROWS, fine=16, width=16, depth=1, heads=2, expand=1)


def trained() -> Learned:
    """As if it had been: no leaf is 0, so the clip, its noise and the level all count."""
    leaves, structure = jax.tree.flatten(initial_parameters(KEY, CONFIG))
    keys = jax.random.split(jax.random.key(1), len(leaves))
    moved = [x + 0.1 * jax.random.normal(key, x.shape) for x, key in zip(leaves, keys, strict=True)]
    return Learned(jax.tree.unflatten(structure, moved), CONFIG)


LEARNED = trained()


def video_of(frames: int) -> Video:
    """Random surfaces with a hole in each frame but the first, an alpha of any value, and a pixel without distance."""
    keys = jax.random.split(jax.random.key(2), 3)
    shape = (5, ROWS, 2 * ROWS)
    alpha = jax.random.uniform(keys[0], shape).at[1:, 4:10, 10:20].set(0.0).at[0].set(1.0)
    distance = jax.random.uniform(keys[1], shape, minval=1.0, maxval=3.0).at[:, 12, 3].set(0.0)
    video = Video(jax.random.uniform(keys[2], (*shape, 3)), alpha.at[:, 12, 3].set(1.0), distance, POSES)
    return jax.tree.map(lambda x: x[:frames], video)


def background():
    distance, face = meet_shell(SHELL, jnp.zeros(3), pixel_rays(ROWS, 2 * ROWS))
    colours = jax.random.uniform(jax.random.key(3), (6, 3))
    return background_of(Panorama(colours[face], distance, distance > 0), SHELL)


BACKGROUNDS = pytest.mark.parametrize("room", [None, background()], ids=["no shell", "shell"])


def restore(video, key=KEY, **options):
    return restore_learned(video, key, learned=LEARNED, observed=OBSERVED, **options)


@BACKGROUNDS
def test_a_room_of_one_colour_gets_no_other(room):
    """Whatever the network says: it errs as much in plain rooms as in others, and there everybody sees it."""
    video = video_of(5)
    plain = video.replace(rgb=jnp.full_like(video.rgb, 0.4))
    if room is not None:
        distance, _ = meet_shell(SHELL, jnp.zeros(3), pixel_rays(ROWS, 2 * ROWS))
        room = background_of(Panorama(plain.rgb[0], distance, distance > 0), SHELL)
    restored = restore(plain, background=room).rgb
    np.testing.assert_allclose(restored, 0.4, atol=1e-3)  # fills are averages in float32


@BACKGROUNDS
def test_observed_pixels_stay_to_the_bit_and_all_is_finite(room):
    video = video_of(3)
    restored = restore(video, background=room)
    trusted, known = video.alpha >= TRUSTED, (video.alpha >= OBSERVED) & (video.distance > 0)
    np.testing.assert_array_equal(restored.rgb[trusted], video.rgb[trusted])
    np.testing.assert_array_equal(restored.distance[known], video.distance[known])
    np.testing.assert_array_equal(restored.alpha, video.alpha)  # alpha still says what was observed
    np.testing.assert_array_equal(restored.world_from_camera, video.world_from_camera)
    assert np.isfinite(restored.rgb).all() and restored.rgb.min() >= 0 and restored.rgb.max() <= 1
    assert np.isfinite(restored.distance).all() and restored.distance.min() > 0
    hole = video.alpha < OBSERVED
    assert np.abs(restored.rgb - video.rgb)[hole].mean() > 0.05


@pytest.mark.parametrize("empty", [slice(1, 2), slice(0, 3)], ids=["a frame", "all frames"])
@BACKGROUNDS
def test_frames_that_show_nothing_stay_finite(empty, room):
    video = video_of(3)
    video = video.replace(
        rgb=video.rgb.at[empty].set(0.0),
        alpha=video.alpha.at[empty].set(0.0),
        distance=video.distance.at[empty].set(0.0),
    )
    restored = restore(video, background=room)
    assert np.isfinite(restored.rgb).all() and np.isfinite(restored.distance).all()


@pytest.mark.parametrize("frames", [1, 2, 3, 4, 5])
def test_as_many_frames_come_back_as_went_in(frames):
    video = video_of(frames)
    restored = restore(video)
    assert jax.tree.map(np.shape, restored) == jax.tree.map(np.shape, video)


def test_one_step_draws_nothing_and_more_draw_a_sample():
    video, other = video_of(3), jax.random.key(9)
    once, again = (restore(video, key) for key in (KEY, other))
    jax.tree.map(np.testing.assert_array_equal, once, again)
    sample, same, another = (restore(video, key, steps=3) for key in (KEY, KEY, other))
    jax.tree.map(np.testing.assert_array_equal, sample, same)
    hole = video.alpha < OBSERVED
    assert np.abs(sample.rgb - another.rgb)[hole].max() > 1e-3
    trusted = video.alpha >= TRUSTED
    np.testing.assert_array_equal(sample.rgb[trusted], another.rgb[trusted])


def test_the_table_gives_this_restorer_and_asks_for_its_weights():
    config = RestoreConfig(method="learned", height=2 * ROWS)
    with pytest.raises(InputError, match=r'"learned" needs a trained network.*restore\.weights'):
        restorer(config)
    found = restorer(config, network=LEARNED)(video_of(3), KEY)
    jax.tree.map(np.testing.assert_array_equal, found, restore(video_of(3)))


@BACKGROUNDS
def test_every_fill_is_what_was_rendered_where_it_is_known(room):
    video = video_of(3)
    clip = clip_of(video, observed=OBSERVED, background=room)
    known = (video.alpha >= OBSERVED) & (video.distance > 0)
    for index in range(CANDIDATES):
        np.testing.assert_array_equal(clip.fill_rgb[..., index, :][known], video.rgb[known])
        np.testing.assert_array_equal(clip.fill_distance[..., index][known], video.distance[known])
    assert np.all(clip.fill_distance > 0) and np.isfinite(clip.fill_rgb).all()
    differ = np.any(clip.fill_rgb[..., :1, :] != clip.fill_rgb, axis=(0, 1, 2, 4))
    assert differ[1] == (room is not None)  # without a shell the far side stands in for it


def test_positions_are_metres_in_the_anchors_axes_wherever_the_world_is():
    """+X is what lies at the anchor's centre column, +Z is up."""
    place, yaw = jnp.array([1.0, -2.0, 0.5]), 0.7
    ahead = jnp.array([jnp.cos(yaw), jnp.sin(yaw), 0.0])  # upright() turns left by yaw
    moved = jnp.stack([place, place + 2 * ahead, place + jnp.array([0.0, 0.0, 3.0])])
    found = positions(jax.vmap(lambda x: upright(x, yaw))(moved))
    np.testing.assert_allclose(found, [[0, 0, 0], [2, 0, 0], [0, 0, 3]], atol=1e-6)  # float32 of some metres
    world = upright(place, 2.1) @ jnp.linalg.inv(upright(jnp.zeros(3), 0.0))
    np.testing.assert_allclose(positions(world @ POSES), positions(POSES), atol=1e-5)
