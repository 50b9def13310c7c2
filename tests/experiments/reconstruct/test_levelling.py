"""A leaning photograph in the main job: levelled first, its ground truth with it, and told; level ones as they were."""

import dataclasses

import numpy as np
import pytest

from experiments.reconstruct.inputs import SAMPLES, InputConfig, input_views, levelled_views, told_panorama
from experiments.reconstruct.run_metrics import lean as lean_metrics
from rein3d_jax.depth.level import LEANED, NOT_ASKED, STOOD_LEVEL, level_panorama
from rein3d_jax.geometry.poses import equirectangular_camera, rigid
from rein3d_jax.geometry.resample import perspective_crop
from rein3d_jax.geometry.rotations import matrix_from_quats
from rein3d_jax.geometry.sphere import world_from_camera_axes
from rein3d_jax.io.pictures.distance import write_distance_exr
from rein3d_jax.io.pictures.image import write_rgb
from rein3d_jax.io.pictures.panorama import read_panorama

ROOM = SAMPLES / "room"
PICTURE, DISTANCE = ROOM / "input.png", ROOM / "input_distance.exr"


@pytest.fixture(scope="module")
def tilted(tmp_path_factory):
    """Files of the packaged room as a camera that leaned by 6 degrees would take it, and its room_from_picture."""
    folder, half = tmp_path_factory.mktemp("tilted"), np.radians(6.0) / 2
    room_from_picture = matrix_from_quats(np.array([np.cos(half), 0.6 * np.sin(half), 0.8 * np.sin(half), 0]))
    leaning = level_panorama(read_panorama(PICTURE, distance=DISTANCE), room_from_picture.T)
    write_rgb(folder / "pano.png", np.asarray(leaning.rgb))
    write_distance_exr(folder / "distance.exr", np.where(leaning.valid, leaning.distance, 0))
    return folder, np.asarray(room_from_picture)


def test_the_packaged_room_stands_level_and_stays_bit_for_bit():
    config = InputConfig()
    panorama, _, lean = told_panorama(config)
    given = read_panorama(PICTURE, distance=DISTANCE, height=256)
    assert lean.verdict == STOOD_LEVEL
    for name in ("rgb", "distance", "valid"):
        np.testing.assert_array_equal(getattr(panorama, name), getattr(given, name))
    for view, kept in zip(input_views(config), levelled_views(input_views(config), lean), strict=True):
        np.testing.assert_array_equal(view.camera.world_from_camera, kept.camera.world_from_camera)


@pytest.mark.parametrize("with_distance", [True, False])
def test_a_leaning_picture_is_levelled_and_told(tilted, with_distance):
    folder, room_from_picture = tilted
    distance = str(folder / "distance.exr") if with_distance else None
    panorama, _, lean = told_panorama(InputConfig(str(folder / "pano.png"), distance, None))
    up = np.asarray(lean.level_from_picture) @ room_from_picture.T @ [0, 0, 1.0]
    assert np.degrees(np.arccos(min(up[2], 1))) < 1  # the bar for real rooms; 6 before
    said = lean_metrics(lean)
    assert said["verdict"] == LEANED and abs(said["degrees"] - 6) < 1 and "was levelled" in said["told"]
    assert bool(panorama.valid.any()) == with_distance


def test_views_of_the_truth_are_rotated_with_the_picture(tilted):
    """A view from the origin shows what the levelled panorama shows there, as it showed what the picture did."""
    folder, room_from_picture = tilted
    config = InputConfig(str(folder / "pano.png"), None, str(ROOM / "scene.json"))
    panorama, _, lean = told_panorama(config)
    into_picture = rigid(room_from_picture.T, np.zeros(3, np.float32))
    views = [
        dataclasses.replace(v, camera=v.camera.replace(world_from_camera=into_picture @ v.camera.world_from_camera))
        for v in input_views(config)[:4]  # the origin's
    ]
    place = equirectangular_camera(rigid(world_from_camera_axes(), np.zeros(3)), 256).world_from_camera

    def error(views):
        return np.mean([np.abs(perspective_crop(panorama.rgb, place, v.camera) - v.rgb).mean() for v in views])

    upright = [view for view in input_views(config)[:4]]
    assert error(levelled_views(views, lean)) < 0.5 * error(views)
    assert error(levelled_views(views, lean)) < 1.3 * error(upright) + 0.01  # but for the heading and half a degree


def test_what_is_known_of_the_level_room_comes_back_to_the_picture(tilted):
    folder, _ = tilted
    files = str(folder / "pano.png"), str(folder / "distance.exr")
    panorama, _, lean = told_panorama(InputConfig(*files, None))
    back = level_panorama(panorama, lean.level_from_picture.T)
    given = read_panorama(files[0], distance=files[1], height=256)
    known = np.asarray(given.valid & back.valid)
    off = np.abs(np.log(np.asarray(back.distance)[known] / np.asarray(given.distance)[known]))
    assert np.median(off) < 0.01 and np.mean(off > 0.1) < 0.1  # a pixel or two beside every edge


def test_level_false_takes_the_picture_as_it_came(tilted):
    folder, _ = tilted
    panorama, _, lean = told_panorama(InputConfig(str(folder / "pano.png"), None, None, level=False))
    assert lean.verdict == NOT_ASKED
    np.testing.assert_array_equal(panorama.rgb, read_panorama(folder / "pano.png", height=256).rgb)
