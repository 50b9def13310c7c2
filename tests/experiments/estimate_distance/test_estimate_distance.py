"""The command on a small room: a file of the picture's own size, what it says, and what it refuses."""

import json

import cv2
import numpy as np
import pytest

from experiments.estimate_distance import __main__ as command
from rein3d_jax.io.pictures.distance import read_distance
from rein3d_jax.io.pictures.image import read_rgb

QUICK = ["depth.method=shell", "shell.climbers=32", "shell.rounds=4"]  # any box will do


@pytest.fixture
def estimate(rooms, tmp_path):
    """(settings, picture) -> exit code; writes map.exr, map.json."""
    files = ["--output", str(tmp_path / "map.exr"), "--json", str(tmp_path / "map.json")]

    def run(*settings, picture=rooms / "room2" / "input.png"):
        chosen = [part for setting in ("input.level=false", *settings) for part in ("--set", setting)]  # aslant stripes
        return command.main(["--input", str(picture), *files, *chosen])

    return run


@pytest.mark.slow  # a whole fit
def test_a_photo_gets_metres_by_the_camera_s_height_at_its_own_size(rooms, estimate, tmp_path, capsys):
    photo = cv2.resize(cv2.imread(str(rooms / "room2" / "input.png")), (320, 160))
    cv2.imwrite(str(tmp_path / "photo.png"), photo)
    assert estimate(*QUICK, "input.height=64", "input.camera_height=1.25", picture=tmp_path / "photo.png") == 0
    distance, valid = read_distance(tmp_path / "map.exr", (160, 320))
    assert valid.all()
    # Straight down is the camera's height, whatever the fit; the nearest of 64 rows is 1.4 degrees off.
    np.testing.assert_allclose(distance[-1], 1.25, rtol=1e-3)
    facts = json.loads((tmp_path / "map.json").read_text())
    assert facts["size"] == [320, 160] and facts["method"] == "shell" and facts["unknown"] == 0
    assert facts["camera_height"] == 1.25 and facts["camera_height_given"] and facts["seconds"] > 0
    assert read_rgb(tmp_path / "map_colours.png").shape == (160, 320, 3)
    assert "camera at 1.25 m, " in capsys.readouterr().out


def test_a_given_map_is_written_as_metres_with_its_holes(rooms, estimate, tmp_path):
    truth, _ = read_distance(rooms / "room2" / "input_distance.exr")
    values = 3 / truth
    values[10:14, 20:40] = 0
    np.save(tmp_path / "disparity.npy", values)
    given = [f"input.distance={tmp_path / 'disparity.npy'}", "input.distance_kind=disparity", "input.height=64"]
    assert estimate(*given, "input.camera_height=1.4") == 0
    distance, valid = read_distance(tmp_path / "map.exr")
    np.testing.assert_array_equal(valid, values > 0)
    np.testing.assert_allclose(distance[valid], truth[valid], rtol=5e-3)  # a floor of 64 rows, among a chest's top
    facts = json.loads((tmp_path / "map.json").read_text())
    assert facts["method"] == "given" and "multiplied by 3" in facts["converted"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--input", "nowhere.jpg", "--output", "map.exr"], "nowhere.jpg cannot be read"),
        (["--input", "nowhere.jpg", "--output", "map.png"], "let its name end in .exr"),
        (["--input", "pano.exr", "--output", "./pano.exr"], "is the picture itself"),
        (
            ["--input", "x.jpg", "--output", "x.exr", "--set", "shell.camera_height=2"],
            "did you mean input.camera_height?",
        ),
    ],
)
def test_bad_input_is_one_line_and_exit_2(arguments, words, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert command.main(arguments) == 2
    error = capsys.readouterr().err
    assert words in error and error.count("\n") == 1 and not list(tmp_path.iterdir())
