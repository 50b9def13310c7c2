"""The evaluation, whole, on two tiny rooms: what its JSON holds, that it goes on after a kill, and what it says when
the input is at fault."""

import json
import shutil

import numpy as np
import pytest

from experiments.evaluate import __main__ as evaluate
from experiments.evaluate import protocols
from experiments.evaluate.room import room_sources
from rein3d_jax.evaluate.clip_features import I3D
from rein3d_jax.io.weights import metric_weights

pytestmark = pytest.mark.slow  # whole evaluations

RECIPE = """
[input]
height = 64
[restore]
height = 32
[explore]
trajectories = 2
viewpoints = 1
"""
METHODS = "coarse,telea,mesh_warp"


@pytest.fixture(scope="module")
def recipe(tmp_path_factory):
    path = tmp_path_factory.mktemp("recipe") / "tiny.toml"
    path.write_text(RECIPE)
    return path


def run(recipe, rooms, folder, *more):
    """Exit code, and the JSON if it was written."""
    file = folder / "result.json"
    code = evaluate.main(["--config", str(recipe), "--rooms", str(rooms), "--json", str(file),
                          "--work", str(folder / "work"), *more])  # fmt: skip
    return code, json.loads(file.read_text()) if file.exists() else None


@pytest.fixture(scope="module")
def finished(recipe, rooms, tmp_path_factory):
    """(folder, result) of an unbroken run."""
    folder = tmp_path_factory.mktemp("evaluate")
    code, result = run(recipe, rooms, folder, "--methods", METHODS)
    assert code == 0
    return folder, result


def test_the_main_jobs_scene_is_measured_like_the_others_and_not_made_twice(recipe, rooms, tmp_path, capsys):
    options = ["--methods", "coarse,refined", "--limit", "1", "--protocol", "novel-views,no-reference"]
    short = ["refine.steps=2", "refine.views.size=32", "refine.batch=1", "refine.sh_degree=0"]
    options += [word for setting in short for word in ("--set", setting)]
    code, result = run(recipe, rooms, tmp_path, *options)
    assert code == 0 and capsys.readouterr().out.count("found finished") >= 5  # by the second protocol
    for protocol in ("novel_views", "no_reference"):
        refined = result[protocol]["refined"]
        assert refined["gaussians"]["mean"] > 0 and refined["seconds"]["mean"] > 0
        assert 0 < refined["coverage"]["mean"] <= 1
    novel = result["novel_views"]
    assert novel["refined"]["coverage"]["mean"] > novel["coarse"]["coverage"]["mean"]  # a fill, where that has none


def test_layout(finished):
    result = finished[1]
    assert result["rooms"] == ["room2", "room10"] and result["recipe"] == "tiny" and result["seeds"] == {"seed": 0}
    assert result["clip_features"] == "Frechet distance (AlexNet features)"
    assert result["versions"]["jax"] and result["machine"]["cores"] >= 1 and result["config"]["input"]["height"] == 64
    assert [set(result[name]) for name in protocols.PROTOCOLS] == [set(METHODS.split(","))] * 3
    restored, novel = result["restoration"]["telea"], result["novel_views"]["mesh_warp"]
    pixels = (
        "psnr",
        "psnr_hole",
        "psnr_observed",
        "psnr_disoccluded",
        "ssim",
        "ssim_hole",
        "lpips",
        "ws_psnr",
        "ws_ssim",
    )
    assert {*pixels, "seam", "seam_truth", "flicker", "flicker_truth", "frechet_alexnet", "seconds"} <= set(restored)
    assert {*pixels, "psnr_at_1-2m", "abs_rel", "abs_rel_hole", "delta_1.25", "coverage", "triangles"} <= set(novel)
    assert {"niqe", "brisque", "coverage"} <= set(result["no_reference"]["coarse"])
    assert result["novel_views"]["coarse"]["gaussians"]["mean"] == 64 * 128


def test_means_and_errors_by_hand(finished):
    for methods in (finished[1][name] for name in protocols.PROTOCOLS):
        for metrics in methods.values():
            for name, row in metrics.items():
                if name.startswith("frechet"):
                    assert row["sem"] is None and row["rooms"] == {} and row["clips"] == 2
                    continue
                values = np.array([row["rooms"][room] for room in row["rooms"]])
                # float32 statistics of values rounded to six digits
                np.testing.assert_allclose(row["mean"], values.mean(), rtol=1e-5, atol=1e-9)
                if len(values) == 2:
                    slack = 5e-6 * np.abs(values).max()  # six digits: each value is off by up to 5e-6 of itself
                    np.testing.assert_allclose(row["sem"], abs(values[0] - values[1]) / 2, rtol=1e-4, atol=slack)


def test_figures_are_plausible(finished):
    novel, restored = finished[1]["novel_views"], finished[1]["restoration"]
    for methods in (novel, restored):
        assert methods["coarse"]["psnr_observed"]["mean"] > methods["coarse"]["psnr_hole"]["mean"] + 5
    assert novel["telea"]["coverage"]["mean"] == 1 > novel["coarse"]["coverage"]["mean"]
    assert novel["mesh_warp"]["psnr_observed"]["mean"] > 25  # smooth colours, exact distance


def test_goes_on_where_it_was_killed(finished, recipe, rooms, tmp_path, monkeypatch):
    folder, before = finished
    shutil.copytree(folder / "work", tmp_path / "work")
    (broken,) = (tmp_path / "work").glob("*/restoration/room10/telea.json")
    broken.write_text(broken.read_text()[:100])  # killed in the middle of an unsafe write
    (gone,) = (tmp_path / "work").glob("*/novel_views/room2/coarse.json")
    gone.unlink()
    made = []
    for name, (protocol, offered) in protocols.PROTOCOLS.items():

        def spy(method, room, tools, run=protocol, name=name):
            made.append((name, method))
            return run(method, room, tools)

        monkeypatch.setitem(protocols.PROTOCOLS, name, (spy, offered))
    code, after = run(recipe, rooms, tmp_path, "--methods", METHODS)
    assert code == 0 and sorted(made) == [("novel_views", "coarse"), ("restoration", "telea")]
    for name in protocols.PROTOCOLS:
        assert _without_seconds(after[name]) == _without_seconds(before[name])


def _without_seconds(methods):
    return {m: {k: v for k, v in metrics.items() if "seconds" not in k} for m, metrics in methods.items()}


def test_another_recipe_is_measured_anew(finished, recipe, rooms, tmp_path, monkeypatch):
    shutil.copytree(finished[0] / "work", tmp_path / "work")
    made = []

    def fake(method, room, tools):
        made.append(room.name)
        return protocols.Outcome({"psnr": 1.0, "missing": float("nan")})

    monkeypatch.setitem(protocols.PROTOCOLS, "restoration", (fake, protocols.OF_CLIPS))
    choice = ("--methods", "coarse", "--protocol", "restoration", "--set", "restore.observed=0.4")
    _, result = run(recipe, rooms, tmp_path, *choice)
    assert made == ["room2", "room10"] and result["recipe"] == "tiny restore.observed=0.4"
    assert result["restoration"]["coarse"] == {
        "psnr": {"mean": 1.0, "sem": 0.0, "rooms": {"room2": 1.0, "room10": 1.0}}
    }


def test_rooms_in_the_order_of_their_numbers(rooms, tmp_path):
    assert [room.name for room in room_sources(rooms)] == ["room2", "room10"]
    assert [room.name for room in room_sources(rooms, 1)] == ["room2"]
    (one,) = room_sources(rooms / "room2")
    assert one.truth == rooms / "room2" / "scene.json" and one.rgb == rooms / "room2" / "input.png"


def test_panoramas_alone_are_measured_without_reference(recipe, rooms, tmp_path, capsys):
    for name in ("input.png", "input_distance.exr"):
        (tmp_path / "own").mkdir(exist_ok=True)
        shutil.copy(rooms / "room2" / name, tmp_path / "own" / name)
    code, _ = run(recipe, tmp_path / "own", tmp_path, "--methods", "coarse")
    assert code == 2 and "without ground truth: give --protocol no-reference" in capsys.readouterr().err
    code, own = run(recipe, tmp_path / "own", tmp_path, "--methods", "coarse", "--protocol", "no-reference")
    code2, room = run(recipe, rooms / "room2", tmp_path, "--methods", "coarse", "--protocol", "no-reference")
    assert code == code2 == 0 and own["rooms"] == ["input"]
    both = [result["no_reference"]["coarse"] for result in (own, room)]
    assert all(both[0][name]["mean"] == both[1][name]["mean"] for name in ("niqe", "brisque", "coverage"))


def no_file(name):
    """A change of a room's folder: a file is lost."""
    return lambda room: (room / name).unlink()


FAULTS = {
    "no folder": (None, ("--rooms", "nowhere"), "nowhere is no folder"),
    "no rooms": (None, ("--rooms", "."), "holds no panorama"),
    "method": (None, ("--methods", "magic"), '"magic" is unknown; choose from coarse'),
    "protocol": (None, ("--protocol", "novel"), '"novel" is unknown; choose from restoration, novel-views'),
    "method of another": (None, ("--protocol", "restoration", "--methods", "refined"), "has only the methods coarse"),
    "limit": (None, ("--limit", "0"), "--limit 0 leaves no room"),
    "missing picture": (no_file("video2.png"), (), "video2.png"),
    "missing distance": (no_file("pano_distance.exr"), (), "pano_distance.exr"),
    "i3d": (None, ("--i3d", "none.npz"), "none.npz"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_faults_are_one_clear_line(name, recipe, rooms, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    change, options, message = FAULTS[name]
    shutil.copytree(rooms / "room2", tmp_path / "in" / "room2")
    if change:
        change(tmp_path / "in" / "room2")
    code, result = run(recipe, tmp_path / "in", tmp_path, *options)
    said = capsys.readouterr().err
    assert code == 2 and result is None and message in said and said.count("\n") == 1 and said.startswith("evaluate: ")


@pytest.mark.parametrize(("part", "protocol", "message"), [
    ("video", "restoration", "has no video"), ("views", "novel-views", None), ("panos", "novel-views", None)
])  # fmt: skip
def test_rooms_that_lack_a_part(part, protocol, message, recipe, rooms, tmp_path, capsys):
    """Views or panoramas alone will do; a protocol that has nothing to go by says so."""
    shutil.copytree(rooms / "room2", tmp_path / "in" / "room2")
    file = tmp_path / "in" / "room2" / "scene.json"
    scene = json.loads(file.read_text())
    del scene[part]
    file.write_text(json.dumps(scene))
    options = ("--protocol", protocol, "--methods", "mesh_warp")
    code, result = run(recipe, tmp_path / "in", tmp_path, *options)
    if message:
        assert code == 2 and message in capsys.readouterr().err
    else:
        assert code == 0 and ("abs_rel" in result["novel_views"]["mesh_warp"]) == (part == "views")


def test_nothing_to_do_is_said(capsys):
    assert evaluate.main([]) == 2 and "give --rooms" in capsys.readouterr().err
    assert evaluate.main(["--rooms", "x"]) == 2 and "also needs --json" in capsys.readouterr().err
    assert evaluate.main(["--chart"]) == 2 and "needs result files" in capsys.readouterr().err


@pytest.fixture
def fake_i3d(tmp_path, monkeypatch):
    """A file that `i3d_weights` takes while its network has a sixteenth of its channels."""
    read, wanted = metric_weights._read, {}

    def narrow(shapes):
        if "Logits/Conv3d_0c_1x1.kernel" not in shapes:  # another metric's
            return shapes
        return {name: (*x[:-2], *(n // 16 or n for n in x[-2:])) for name, x in shapes.items()}

    monkeypatch.setattr(metric_weights, "_read", lambda path, shapes, mend: wanted.update(narrow(shapes)))
    metric_weights.i3d_weights(tmp_path)
    monkeypatch.setattr(metric_weights, "_read", lambda path, shapes, mend: read(path, narrow(shapes), mend))
    random = np.random.default_rng(0)
    spread = {name: np.prod(shape[:-1]) ** -0.5 for name, shape in wanted.items()}
    path = tmp_path / "i3d.npz"
    np.savez(path, **{name: random.normal(0, spread[name], shape) for name, shape in wanted.items()})
    return path


def with_frames(rooms, folder, count):
    """The rooms, their videos there and back again until they have so many frames."""
    shutil.copytree(rooms, folder)
    for room in folder.iterdir():
        scene = json.loads((room / "scene.json").read_text())
        there = scene["video"]
        scene["video"] = ((there + there[-2:0:-1]) * count)[:count]
        (room / "scene.json").write_text(json.dumps(scene))
    return folder


def test_the_frechet_distance_by_i3ds_features_is_the_fvd_and_says_so(fake_i3d, recipe, rooms, tmp_path, capsys):
    chosen = ["--protocol", "restoration", "--methods", "coarse", "--i3d", str(fake_i3d)]
    code, result = run(recipe, with_frames(rooms, tmp_path / "long", I3D.frames), tmp_path, *chosen)
    assert code == 0 and result["clip_features"] == "FVD (I3D, Kinetics-400 logits)"
    found = result["restoration"]["coarse"]
    assert found["frechet_i3d"]["mean"] >= 0 and found["frechet_i3d"]["clips"] == 2 and "frechet_alexnet" not in found
    assert run(recipe, rooms, tmp_path, *chosen)[0] == 2
    assert "needs clips of 9 frames, not 4" in capsys.readouterr().err
