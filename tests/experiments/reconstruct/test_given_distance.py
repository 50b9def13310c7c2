"""Maps of other tools come in by their named kind, never silently; what is no distance is refused before any stage."""

import re

import numpy as np
import pytest

from experiments.reconstruct.inputs import InputConfig, told_panorama
from rein3d_jax.errors import InputError
from rein3d_jax.io.pictures.distance import read_distance
from rein3d_jax.upsample import coarser_distance

EYE = 1.4  # metres of the room's input above its floor


@pytest.fixture(scope="module")
def truth(rooms):
    return read_distance(rooms / "room2" / "input_distance.exr")[0]


@pytest.fixture
def told(rooms, tmp_path):
    """(values, **settings) -> the panorama and what was said."""

    def tell(values, **settings):
        np.save(tmp_path / "map.npy", values)
        files = (str(rooms / "room2" / "input.png"), str(tmp_path / "map.npy"), None, 64)
        return told_panorama(InputConfig(*files, level=False, **settings))[:2]  # its stripes run aslant

    return tell


def test_metres_stay_as_they_are(told, truth):
    panorama, said = told(truth)
    np.testing.assert_array_equal(panorama.distance, truth)
    assert said == ""


@pytest.mark.parametrize(
    ("values", "settings", "words"),
    [
        (lambda d: d / 7.3, {"distance_kind": "relative"}, "distance up to a factor; multiplied by 7.3"),
        (lambda d: 40 / d, {"distance_kind": "disparity"}, "inverse distance, .*; multiplied by 40"),
        (lambda d: 50 * d, {"scale": "camera_height"}, "^multiplied by 0.02, so that the floor lies 1.4 m below"),
    ],
)
def test_what_has_no_unit_is_scaled_by_the_camera_s_height(told, truth, values, settings, words):
    panorama, said = told(values(truth), camera_height=EYE, **settings)
    np.testing.assert_allclose(panorama.distance, truth, rtol=5e-3)  # a floor of 64 rows, among a chest's top
    assert re.search(words, said)


def test_half_a_size_is_brought_to_the_picture_s_with_its_edges_kept(told, truth):
    panorama, said = told(np.asarray(coarser_distance(truth, rows=32)))
    off = np.abs(np.asarray(panorama.distance) / truth - 1)
    assert np.median(off) < 2e-3  # curvature of 1 / d between pixels of 5.6 degrees: their square / 8 = 1e-3
    assert said == "the map is 64x32, brought to 128x64"


@pytest.mark.parametrize(
    ("values", "settings", "words"),
    [
        (lambda d: d / d.max(), {}, "nothing farther than 0.99 m.*input.distance_kind = relative"),
        (lambda d: 100 * d, {}, "median of .* no room is so large.*input.distance_kind = relative"),
        (lambda d: 1 / d, {}, "surfaces are flat if .* input.distance_kind = disparity"),
        (lambda d: 255 / d, {}, "surfaces are flat if .* input.distance_kind = disparity"),
        (lambda d: d, {"scale": "camera_height", "camera_height": 160.0}, "so large; check input.camera_height"),
        (lambda d: np.where(np.arange(64)[:, None] < 36, d, 0), {"distance_kind": "relative"}, "shows no floor"),
        (lambda d: d[:, :64], {}, "64 x 64 values .* twice as many columns as rows"),
    ],
)
def test_what_is_no_distance_is_refused_in_one_line(told, truth, values, settings, words):
    with pytest.raises(InputError, match=words) as caught:
        told(values(truth), **settings)
    assert "map.npy" in str(caught.value) and "\n" not in str(caught.value)


def test_a_word_that_is_no_kind_is_refused():
    with pytest.raises(InputError, match="distance_kind must be one of distance, z, disparity, relative"):
        InputConfig(distance_kind="inverse")


@pytest.mark.parametrize(("picture", "rows"), [(2048, 512), (512, 512), (500, 480), (96, 96), (40, 64)])
def test_a_picture_smaller_than_asked_keeps_its_own_rows(picture, rows):
    """In steps of 32, and 64 at least."""
    assert InputConfig(height=512).rows(picture) == rows
