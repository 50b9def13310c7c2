"""The command on a small room: a file of the picture's own size, what it says, and what it refuses."""

import json

import cv2
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from experiments.estimate_distance import __main__ as command
from rein3d_jax.geometry.rotations import matrix_from_quats, normalize_quats
from rein3d_jax.geometry.shell import RoomShell, meet_shell
from rein3d_jax.geometry.sphere import pixel_rays
from rein3d_jax.io.pictures.distance import read_distance, write_distance_exr
from rein3d_jax.io.pictures.image import write_rgb
from rein3d_jax.io.pictures.photo import read_rgb

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


def test_a_picture_that_leaned_is_levelled_and_written_beside_its_distance(estimate, tmp_path):
    height = 128
    lean = matrix_from_quats(normalize_quats(jnp.array([1.0, 0.05, 0.03, 0.0])))  # 6.7 degrees
    shell = RoomShell(jnp.float32(0.2), jnp.array([2.0, 3.0, 2.5, 2.2]), jnp.float32(1.6), jnp.float32(1.0))
    distance, _ = meet_shell(shell, jnp.zeros(3), pixel_rays(height, 2 * height) @ lean.T)
    _, face = meet_shell(shell, jnp.zeros(3), pixel_rays(4 * height, 8 * height) @ lean.T)
    photo = jax.random.uniform(jax.random.key(0), (6, 3))[face].reshape(height, 4, 2 * height, 4, 3).mean((1, 3))
    write_rgb(tmp_path / "photo.png", np.asarray(photo))
    write_distance_exr(tmp_path / "given.exr", np.asarray(distance))
    given = [f"input.distance={tmp_path / 'given.exr'}", "input.height=128", "input.level=true"]
    assert estimate(*given, picture=tmp_path / "photo.png") == 0
    facts = json.loads((tmp_path / "map.json").read_text())
    assert "leaned by 6" in facts["lean"]
    picture, (metres, _) = read_rgb(tmp_path / "map_level.png"), read_distance(tmp_path / "map.exr")
    assert picture.shape == (height, 2 * height, 3)
    # The floor is level now, but for half a degree and the nearest of 128 rows; 6 degrees at 28 from the nadir are 5 %.
    assert np.abs(floor_of(metres) / 1.6 - 1).max() < 0.03 < np.abs(floor_of(distance) / 1.6 - 1).max()


def test_weights_that_are_none_are_refused_by_name(estimate, capsys):
    assert estimate("depth.weights=nowhere/weights") == 2
    assert "nowhere/weights is no folder" in capsys.readouterr().err


def floor_of(distance):
    """Metres below the camera of what a map shows in its lowest rows."""
    height = len(distance)
    return -np.asarray(pixel_rays(height, 2 * height))[112:, :, 2] * np.asarray(distance)[112:]


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
