"""Walks stay where it is safe, and what a camera sees along them is the room."""

import json
import re

import cv2
import numpy as np
import OpenImageIO as oiio
import pytest

from experiments.export import __main__ as export
from experiments.export.walk import STEP, SafeArea, headings, random_walk, read_walk
from experiments.run_folder import open_run
from rein3d_jax.errors import InputError


@pytest.fixture(scope="module")
def area(run_folder):
    return SafeArea(open_run(run_folder))


def clearance(places, room):
    """Metres from places (n, 2) to the nearest wall or to the chest."""
    walls = (room.walls[:2] - np.abs(places)).min(axis=1)
    low, high = room.chest[:, :2]
    return np.minimum(walls, np.linalg.norm(np.maximum(np.maximum(low - places, places - high), 0), axis=1))


@pytest.mark.parametrize("seed", range(5))
def test_random_walks_keep_clear_of_everything(area, run_folder, room, seed):
    places = random_walk(area, 300, seed)
    assert (places[0] == 0).all() and area.holds(places).all()
    way = np.linalg.norm(np.diff(places, axis=0), axis=1)
    assert way.max() <= STEP + 1e-9 and np.median(way) == pytest.approx(STEP)  # shorter across a corner
    wanted = open_run(run_folder).config.explore.clearance
    # A column is 2.8 degrees wide: 0.15 m at 3 m, and a place lies half of it off what was measured.
    assert clearance(places, room).min() > wanted - 0.075
    assert np.linalg.norm(places, axis=1).max() > 0.8  # it goes somewhere


def test_the_same_seed_is_the_same_walk(area):
    np.testing.assert_array_equal(random_walk(area, 50, 7), random_walk(area, 50, 7))
    assert not np.array_equal(random_walk(area, 50, 7), random_walk(area, 50, 8))


def test_the_outline_turns_left_and_bounds_the_area(area):
    outline = area.outline()
    x, y = outline.T
    assert np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) > 0
    assert area.holds(0.99 * outline * (area.reach.min() / area.reach[::-1])[:, None]).all()
    assert not area.holds(1.01 * outline).any()


def test_a_given_walk_is_followed_evenly_and_looked_along(tmp_path):
    (tmp_path / "walk.json").write_text("[[0, 0], [2, 0], [2, 1]]")
    places = read_walk(tmp_path / "walk.json", 31)
    np.testing.assert_allclose(np.linalg.norm(np.diff(places, axis=0), axis=1), 0.1, atol=1e-9)
    yaws = headings(places)
    np.testing.assert_allclose(yaws[:16], 0, atol=1e-9)  # along +X
    np.testing.assert_allclose(yaws[21:], np.pi / 2, atol=1e-9)  # then along +Y, to the left
    assert (np.diff(yaws) >= -1e-9).all()


@pytest.mark.parametrize("text", ["{}", "[[0, 0]]", "[[0, 0, 0], [1, 1, 1]]", '[["a", 0], [1, 1]]', "[[0, 0], [1]]"])
def test_what_is_no_walk_is_refused(tmp_path, text):
    (tmp_path / "walk.json").write_text(text)
    with pytest.raises(InputError, match=r"walk.json is no walk: give a JSON list"):
        read_walk(tmp_path / "walk.json", 3)


def test_a_walk_of_one_place_is_refused(tmp_path):
    (tmp_path / "walk.json").write_text("[[1, 1], [1, 1]]")
    with pytest.raises(InputError, match=r"walk.json names one place only"):
        read_walk(tmp_path / "walk.json", 3)


def test_frames_show_the_room(run_folder, room, room_seen, tmp_path, capsys):
    (tmp_path / "walk.json").write_text("[[0, 0], [0.4, 0.4], [5, 0.4]]")
    arguments = ["--to", "posed-frames", "--walk", str(tmp_path / "walk.json"), "--frames", "11", "--size", "24x32"]
    assert export.main([str(run_folder), *arguments, "--output", str(tmp_path)]) == 0
    folder = tmp_path / "posed-frames"
    outside = int(re.search(r"11 frames, (\d+) of them outside the safe area", capsys.readouterr().out)[1])
    too_near = clearance(read_walk(tmp_path / "walk.json", 11), room) < 0.3  # of 0.4; it ends beyond the wall
    assert too_near.sum() <= outside < 11
    told = json.loads((folder / "frames.json").read_text())["frames"][1]
    v, u = np.mgrid[0.5:24, 0.5:32]
    rays = np.stack([(u - 16) / 16, (v - 12) / 16, np.ones((24, 32))], axis=-1)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    rays = rays @ np.array(told["world_from_camera"])[:3, :3].T
    rgb, distance = room_seen(np.array(told["position"]), rays)
    found = oiio.ImageBuf(str(folder / told["distance"])).get_pixels()[..., 0]
    seen = cv2.imread(str(folder / told["rgb"]))[..., ::-1] / 255
    # The scene is splats of 2.8 degrees.
    assert np.median(np.abs(found - distance)) < 0.05 and np.median(np.abs(seen - rgb)) < 0.06
    normals = oiio.ImageBuf(str(folder / told["normals"])).get_pixels()
    known = found > 0
    np.testing.assert_allclose(np.linalg.norm(normals[known], axis=-1), 1, atol=1e-5)  # float32
    assert (np.sum(normals * rays, axis=-1)[known] < 0.1).mean() > 0.98  # towards the camera
    assert np.median(np.abs(normals[known]).max(axis=-1)) > 0.99  # walls, floor and chest stand along the axes


@pytest.mark.parametrize(("option", "text"), [("--frames", "0"), ("--size", "640"), ("--size", "0x9"), ("--up", "x")])
def test_wrong_options_are_refused(run_folder, option, text, capsys):
    with pytest.raises(SystemExit):
        export.main([str(run_folder), "--to", "posed-frames", option, text])
    assert option in capsys.readouterr().err
