"""Laws of super-resolution: what was measured stays, nothing moves, no column is special, nothing drifts."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.geometry.poses import upright
from rein3d_jax.geometry.pyramid import blocks
from rein3d_jax.geometry.sphere import pixel_rays
from rein3d_jax.networks.upsampler import read_upsampler
from rein3d_jax.scene import Panorama, Video
from rein3d_jax.upsample import UpsampleConfig, upsample_picture, upsample_video
from rein3d_jax.upsample.dual_aggregation import initial_upsampler, twice_as_fine
from rein3d_jax.upsample.measured import as_measured, borne_out
from rein3d_jax.upsample.reference import reference_colours

METHODS = ["bicubic", "learned"]
HALF = np.array([2.0, 1.5, 1.2])  # metres from the origin to the walls of the room below


@pytest.fixture(scope="module")
def network():
    return read_upsampler()


def halved(picture):
    return blocks(picture).mean(axis=2)


def smooth(rows):
    """sRGB (rows, 2 rows, 3): colours that turn slowly with the direction."""
    return 0.5 + 0.4 * jnp.sin(3 * pixel_rays(rows, 2 * rows) + jnp.array([0.0, 1.0, 2.0]))


def room(rows, position=(0.0, 0.0, 0.0)):
    """(sRGB, distance) of a box room with stripes, from a place in it."""
    ray = np.asarray(pixel_rays(rows, 2 * rows), np.float64)
    at = np.array(position)
    distance = np.min((HALF - np.sign(ray) * at) / np.maximum(np.abs(ray), 1e-9), axis=-1)
    point = at + distance[..., None] * ray
    rgb = 0.5 + 0.25 * np.sin(6 * point) * np.cos(5 * point[..., [1, 2, 0]])
    return jnp.float32(rgb), jnp.float32(distance)


@pytest.mark.parametrize("method", METHODS)
def test_what_was_measured_is_the_mean_of_what_is_finer(method, network):
    rgb = jax.random.uniform(jax.random.key(0), (32, 64, 3))
    fine = upsample_picture(rgb, method, network)
    assert fine.shape == (64, 128, 3) and fine.min() >= -1e-6 and fine.max() <= 1 + 1e-6  # float32
    np.testing.assert_allclose(halved(fine), rgb, atol=1e-6)  # float32 means of four


@pytest.mark.parametrize("method", METHODS)
def test_nothing_drifts_however_often(method, network):
    start = once = upsample_picture(smooth(32), method, network)
    for _ in range(3):
        once = upsample_picture(halved(once), method, network)
    np.testing.assert_allclose(once, start, atol=1e-5)  # rounding of the means, through the network


@pytest.mark.parametrize("method", METHODS)
def test_a_smooth_picture_is_what_a_finer_one_would_be(method, network):
    """Nothing is shifted: half a fine pixel off would be 0.4 * 3 * pi / 128 / 2 = 0.015."""
    error = jnp.abs(upsample_picture(halved(smooth(64)), method, network) - smooth(64))
    assert jnp.mean(error) < 1.5e-3 and jnp.percentile(error, 99) < 6e-3


@pytest.mark.parametrize("method", METHODS)
def test_no_column_is_special(method, network):
    rgb = room(32)[0]
    fine, rolled = (upsample_picture(x, method, network) for x in (rgb, jnp.roll(rgb, 32, axis=1)))
    np.testing.assert_allclose(rolled, jnp.roll(fine, 64, axis=1), atol=1e-4)  # float32, sums in another order


def test_one_colour_stays_that_colour(network):
    grey = jnp.full((32, 64, 3), 0.4)
    for method in METHODS:
        np.testing.assert_allclose(upsample_picture(grey, method, network), grey.repeat(2, 0).repeat(2, 1), atol=2e-2)
    np.testing.assert_allclose(upsample_picture(grey, "bicubic"), 0.4, atol=1e-6)  # float32


def test_the_learned_one_is_sharper_than_cubics(network):
    """On what has edges, each pixel the mean of what it covers, against the picture that it was halved from."""
    bright = jnp.sin(2 * pixel_rays(512, 1024) @ jnp.array([1.0, 2.0, 3.0])) > 0
    fine = halved(halved(jnp.where(bright[..., None], 0.7, 0.2) * jnp.ones(3)))
    found = {method: upsample_picture(halved(fine), method, network) for method in METHODS}
    error = {method: float(jnp.mean((picture - fine) ** 2)) for method, picture in found.items()}
    assert error["learned"] < 0.8 * error["bicubic"]


def test_detail_is_weakened_where_it_would_leave_the_range():
    fine = jnp.array([[0.0, 1.0], [0.0, 1.0]])[..., None].repeat(3, -1)
    np.testing.assert_allclose(as_measured(fine, jnp.full((1, 1, 3), 0.9))[..., 0], [[0.8, 1.0]] * 2, atol=1e-6)
    np.testing.assert_allclose(as_measured(fine, jnp.full((1, 1, 3), 0.5))[..., 0], fine[..., 0], atol=1e-6)


def test_only_what_was_measured_is_borne_out():
    fine = jnp.full((2, 4, 3), 0.5).at[:, 2:].set(0.8)
    share = borne_out(fine, jnp.full((1, 2, 3), 0.5))
    np.testing.assert_allclose(share[:, :2], 1, atol=1e-6)
    assert share[:, 2:].max() < 1e-3


def test_at_the_origin_the_reference_is_the_input():
    rgb, distance = room(64)
    known = reference_colours(Panorama(rgb, distance, distance > 0), upright(jnp.zeros(3)), distance)
    assert known.weight.mean() > 0.9  # all but what lies beside creases that look like edges
    np.testing.assert_allclose(known.rgb, rgb, atol=1e-4)  # cubics at pixel centres, directions in float32


def test_from_elsewhere_the_reference_shows_the_same_surface():
    place = (0.4, 0.3, 0.1)
    rgb, distance = room(128)
    truth, away = room(32, place)
    known = reference_colours(Panorama(rgb, distance, distance > 0), upright(jnp.array(place)), away)
    sure = known.weight > 0.5
    assert sure.mean() > 0.5
    assert jnp.percentile(jnp.abs(known.rgb - truth)[sure], 95) < 0.05
    # Points against means over a pixel of 0.2 m: curvature 0.25 (6^2 + 5^2) * 0.2^2 / 24 = 0.025, the filter's as much


def test_what_the_input_did_not_see_has_no_reference():
    rgb, distance = room(64)
    _, away = room(32, (0.4, 0.3, 0.1))
    behind = reference_colours(Panorama(rgb, distance, distance > 0), upright(jnp.zeros(3)), 1.2 * room(32)[1])
    unknown = reference_colours(Panorama(rgb, distance, distance < 0), upright(jnp.array([0.4, 0.3, 0.1])), away)
    assert behind.weight.max() == 0 and unknown.weight.max() == 0


def test_a_frame_nearer_to_a_wall_than_the_input_has_no_finer_reference_there():
    """0.2 m before a wall that the input saw from 2 m: a pixel of the input covers five of the frame."""
    rgb, distance = room(64)
    _, near = room(32, (1.8, 0.0, 0.0))
    known = reference_colours(Panorama(rgb, distance, distance > 0), upright(jnp.array([1.8, 0.0, 0.0])), near)
    assert known.weight[12:20, 28:36].max() == 0


def clip():
    place = (0.4, 0.3, 0.1)
    rgb, distance = room(32, place)
    return Video(rgb[None], jnp.ones((1, 32, 64)), distance[None], upright(jnp.array(place))[None])


def test_the_reference_brings_a_frame_nearer_to_the_truth():
    rgb, distance = room(128)
    coarse, fine = room(64, (0.4, 0.3, 0.1))
    video = clip().replace(rgb=halved(coarse)[None])
    panorama = Panorama(rgb, distance, distance > 0)
    error = {}
    for reference in (False, True):
        finer = upsample_video(video, panorama, config=UpsampleConfig("bicubic", reference))
        assert finer.rgb.shape == (1, 64, 128, 3) and finer.alpha.shape == finer.distance.shape == (1, 64, 128)
        np.testing.assert_allclose(halved(finer.rgb[0]), video.rgb[0], atol=1e-6)  # float32 means
        error[reference] = float(jnp.mean((finer.rgb[0] - coarse) ** 2))
    np.testing.assert_allclose(jnp.median(finer.distance[0] / fine), 1, atol=5e-3)  # planes interpolated
    assert error[True] < 0.8 * error[False]


def test_without_a_method_a_video_is_itself():
    video = clip()
    assert upsample_video(video, None, config=UpsampleConfig()) is video


def test_the_learned_one_asks_for_its_network():
    with pytest.raises(InputError, match="read_upsampler"):
        upsample_picture(jnp.zeros((32, 64, 3)), "learned")


@pytest.mark.parametrize("platform", ["cuda", "tpu"])
def test_it_exports_for_accelerators(platform):
    parameters = jax.eval_shape(lambda: initial_upsampler(jax.random.key(0)))
    picture = jax.ShapeDtypeStruct((64, 128, 3), jnp.float32)
    assert jax.export.export(twice_as_fine, platforms=[platform])(parameters, picture).mlir_module_serialized
