"""The main job, whole, at a size that CI affords; and what it says when the input is at fault."""

import dataclasses
import json
import shutil

import cv2
import numpy as np
import plyfile
import pytest

from experiments.config import load_config
from experiments.reconstruct import __main__ as job
from experiments.reconstruct import job as stages
from experiments.reconstruct.config import ReconstructConfig
from experiments.reconstruct.inputs import SAMPLES, InputConfig, input_panorama, input_views
from experiments.reconstruct.quality import is_novel
from experiments.reconstruct.stage_store import StageStore, blank_stages, read_stage
from experiments.run_folder import open_run
from rein3d_jax.depth.estimate import DepthConfig
from rein3d_jax.geometry.poses import equirectangular_camera, upright
from rein3d_jax.io.pictures.image import write_rgb
from rein3d_jax.io.splats.ply import read_ply
from rein3d_jax.pipeline.stages import Stages
from rein3d_jax.pipeline.survey import with_distance
from rein3d_jax.rasterize import RasterizeConfig, allocate, render
from rein3d_jax.refine import RefineConfig

pytestmark = pytest.mark.slow  # whole jobs


@pytest.fixture(scope="module")
def finished(recipe, tmp_path_factory):
    """The output folder of one unbroken run on the packaged room, with 6 of its 24 ground-truth views."""
    output = tmp_path_factory.mktemp("run") / "room"
    assert job.main(["--config", str(recipe), "--output", str(output)]) == 0
    return output


def test_writes_everything_a_user_was_promised(finished):
    names = {"scene.ply", "viewer.html", "flythrough.mp4", "report.html", "metrics.json", "config.toml", "stages"}
    assert {path.name for path in finished.iterdir()} == names


def test_metrics_say_what_was_measured(finished):
    metrics = json.loads((finished / "metrics.json").read_text())
    seconds = metrics["seconds"]
    assert {"read", "lift", "explore", "peel", "restore", "refine", "write", "total"} == set(seconds)
    assert seconds["total"] >= max(v for k, v in seconds.items() if k != "total")
    assert metrics["count"]["pixels"] == metrics["count"]["lift"] == 64 * 128
    assert metrics["peak_bytes"] > 0 and metrics["overflow"] == 0
    for name in ("coarse", "refined"):
        assert metrics["quality"][name]["views"] == 5  # novel places; the origin's is counted apart


def test_quality_is_that_of_the_scene_in_the_folder(finished, recipe):
    """Another picture's error, from another renderer call: mean squared error of the written scene at each view."""
    run = open_run(finished)
    views = [view for view in input_views(run.config.input) if is_novel(view)]
    found = []
    buffers = allocate(run.refined, [view.camera for view in views], config=run.config.rasterize)  # one program
    for view in views:
        frame, buffers = render(run.refined, view.camera, config=run.config.rasterize, buffers=buffers)
        picture = np.clip(frame.rgb + (1 - frame.alpha[..., None]) * run.backdrop, 0, 1)
        found.append(-10 * np.log10(np.mean((np.asarray(picture) - view.rgb) ** 2)))
    said = json.loads((finished / "metrics.json").read_text())["quality"]["refined"]["psnr"]
    np.testing.assert_allclose(said, np.mean(found), atol=2e-3)  # dB; quaternions of the file are normalised anew


def test_ply_reads_back_equal_and_renders_alike(finished):
    path = finished / "scene.ply"
    vertices = plyfile.PlyData.read(path)["vertex"]
    stored = read_stage(finished / "stages" / "refine.npz", blank_stages(RefineConfig())["refine"])[0]
    alive = np.asarray(stored.alive)
    assert len(vertices) == alive.sum()
    for name, column in (("x", 0), ("y", 1), ("z", 2)):
        np.testing.assert_array_equal(vertices[name], np.asarray(stored.means)[alive, column])
    np.testing.assert_array_equal(vertices["opacity"], np.asarray(stored.opacity_logits)[alive])
    camera = equirectangular_camera(upright(np.array([0.3, 0.1, 0.0])), 32)
    from_file, _ = render(read_ply(path), camera, config=RasterizeConfig())
    in_memory, _ = render(stored, camera, config=RasterizeConfig())
    # Quaternions are normalised on reading, which may move the last bit, and with it which splats a pixel leaves out.
    np.testing.assert_allclose(from_file.rgb, in_memory.rgb, atol=1e-3)


def test_report_is_one_self_contained_page(finished):
    page = (finished / "report.html").read_text()
    assert page.startswith("<!doctype html>") and "http://" not in page and "https://" not in page
    assert page.count("<img") >= 8


def test_saved_config_is_the_config(finished, recipe):
    saved = load_config(ReconstructConfig, finished / "config.toml")
    wanted = load_config(ReconstructConfig, recipe)
    assert saved == dataclasses.replace(wanted, output=str(finished))
    assert "jax" in (finished / "config.toml").read_text().splitlines()[0]


STAGES = ["read", "lift", "explore", "peel", "restore-00", "restore-01", "refine"]


def resume(output, recipe, *more):
    """The names of the stages that a resumed job made again: those whose files it wrote."""
    before = {path.stem: path.stat().st_mtime_ns for path in (output / "stages").iterdir()}
    options = ["--config", str(recipe), "--output", str(output), "--resume", "--set", "input.views=none", *more]
    assert job.main(options) == 0
    after = {path.stem: path.stat().st_mtime_ns for path in (output / "stages").iterdir()}
    return [name for name in STAGES if after[name] != before.get(name)]


@pytest.mark.parametrize("finished_stages", [1, 5, 6])
def test_killed_and_resumed_gives_the_same_bytes(finished, recipe, tmp_path, finished_stages):
    """Killed after 1 (read), 5 (one trajectory restored) or 6 stages (both): only the rest is made again."""
    output = tmp_path / "room"
    shutil.copytree(finished / "stages", output / "stages")
    for name in STAGES[finished_stages:]:
        (output / "stages" / f"{name}.npz").unlink()
    assert resume(output, recipe) == STAGES[finished_stages:]
    for name in ("scene.ply", "flythrough.mp4"):
        assert (output / name).read_bytes() == (finished / name).read_bytes(), name


def test_killed_while_refining_and_resumed_gives_the_same_bytes(finished, recipe, tmp_path, monkeypatch):
    """Killed after the second held-out evaluation; what was saved there is read again, once."""
    output = tmp_path / "room"
    shutil.copytree(finished / "stages", output / "stages")
    (output / "stages" / "refine.npz").unlink()
    save, saved = StageStore.save_unfinished, []

    def killed(store, snapshot):
        save(store, snapshot)
        saved.append(snapshot.step)
        if len(saved) == 2:
            raise SystemExit  # as nothing that a job could answer

    monkeypatch.setattr(StageStore, "save_unfinished", killed)
    with pytest.raises(SystemExit):
        resume(output, recipe)
    assert resume(output, recipe) == ["refine"]
    assert saved[0] == 0 and saved[1] > 0 and all(step > saved[1] for step in saved[2:])
    assert (output / "scene.ply").read_bytes() == (finished / "scene.ply").read_bytes()
    assert not (output / "stages" / "unfinished.npz").exists()


def test_resume_makes_again_what_another_config_made(finished, recipe, tmp_path):
    output = tmp_path / "room"
    shutil.copytree(finished / "stages", output / "stages")
    assert resume(output, recipe, "--set", "refine.steps=2") == ["refine"]


def _bad(tmp_path, name):
    """Arguments of a job whose input is at fault, and a word its message must have."""
    picture, depth = tmp_path / "pano.png", tmp_path / "depth.npy"
    write_rgb(picture, np.full((32, 64, 3), 0.5, np.float32))
    np.save(depth, np.full((32, 64), 2.0, np.float32))
    given = ["--input", str(picture), "--distance", str(depth)]
    if name == "missing file":
        return ["--input", str(tmp_path / "none.jpg")], "none.jpg"
    if name == "not an image":
        picture.write_text("hello")
    if name == "aspect":
        write_rgb(picture, np.zeros((32, 50, 3), np.float32))
    if name == "1x2":
        cv2.imwrite(str(picture), np.zeros((1, 2, 3), np.uint8))
    if name == "depth size":
        np.save(depth, np.ones((16, 32), np.float32))
        return given, "depth.npy"
    if name == "all-zero depth":
        np.save(depth, np.zeros((32, 64), np.float32))
        return given, "depth.npy"
    if name == "all-nan depth":
        np.save(depth, np.full((32, 64), np.nan, np.float32))
        return given, "depth.npy"
    if name == "unknown key":
        return [*given, "--set", "refine.stepz=3"], "refine.stepz"
    if name == "wrong type":
        return [*given, "--set", "refine.steps=many"], "refine.steps"
    if name == "unknown fill":
        return [*given, "--set", "restore.method=magic"], "restore.method"
    if name == "capacity too small":
        return [*given, "--set", "lift.capacity=100"], "lift.capacity"
    if name == "unwritable output":
        return [*given, "--output", str(picture / "below")], "pano.png"
    if name == "views missing":
        return [*given, "--set", "input.views=nowhere.json"], "nowhere.json"
    return given, "pano.png"


CASES = (
    "missing file",
    "not an image",
    "aspect",
    "1x2",
    "depth size",
    "all-zero depth",
    "all-nan depth",
    "unknown key",
    "wrong type",
    "unknown fill",
    "capacity too small",
    "unwritable output",
    "views missing",
)


def test_two_panoramas_are_one_too_many(capsys):
    assert job.main(["one.jpg", "--input", "two.jpg"]) == 2
    assert "one.jpg and --input two.jpg" in capsys.readouterr().err


@pytest.mark.parametrize("name", CASES)
def test_bad_input_is_one_clear_line_and_exit_2(recipe, tmp_path, capsys, name):
    arguments, word = _bad(tmp_path, name)
    output = [] if "--output" in arguments else ["--output", str(tmp_path / "out")]
    assert job.main(["--config", str(recipe), *output, *arguments]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1 and word in lines[0] and "Traceback" not in lines[0], lines


@pytest.fixture
def stopped(recipe, tmp_path, monkeypatch):
    """Runs a job into the folder that is returned, up to where things behind things are made up."""
    monkeypatch.setattr(stages, "peel_scene", lambda *_, **__: 1 / 0)

    def run():
        with pytest.raises(ZeroDivisionError):
            job.main(["--config", str(recipe), "--output", str(tmp_path)])
        return tmp_path

    return run


def test_there_is_something_to_see_before_anything_is_guessed(stopped, capsys):
    output = stopped()
    assert capsys.readouterr().out.count("for a first look") == 1
    assert "a first look" in (output / "report.html").read_text()
    shown = (output / "viewer.html").read_text()
    assert shown.count('"name": "Coarse"') == 1 and '"name": "Refined"' not in shown


def test_what_an_earlier_job_shows_stays_until_there_is_better(stopped, tmp_path):
    (tmp_path / "viewer.html").write_text("an earlier job's")
    stopped()
    assert (tmp_path / "viewer.html").read_text() == "an earlier job's"


def test_a_disk_that_fills_up_loses_nothing_already_written(finished, recipe, tmp_path, capsys):
    """A file size limit stands in for a full disk: root may write anywhere, but no one past it."""
    import resource
    import signal

    output = tmp_path / "room"
    shutil.copytree(finished, output)
    before = {path.name: path.read_bytes() for path in output.iterdir() if path.is_file()}
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, limit[1]))
        code = job.main(["--config", str(recipe), "--output", str(output), "--resume"])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
        signal.signal(signal.SIGXFSZ, handler)
    assert code == 2 and "scene.ply" in capsys.readouterr().err
    after = {path.name: path.read_bytes() for path in output.iterdir() if path.is_file()}
    assert {**after, "config.toml": b""} == {**before, "config.toml": b""}


def test_a_partly_unknown_depth_is_taken_with_its_mask(tmp_path):
    distance = np.full((32, 64), 2.0, np.float32)
    distance[10:14, 5:20], distance[20, 3], distance[21, 3], distance[22, 3] = 0.0, np.nan, np.inf, -1.0
    write_rgb(tmp_path / "pano.png", np.full((32, 64, 3), 0.5, np.float32))
    np.save(tmp_path / "depth.npy", distance)
    config = InputConfig(str(tmp_path / "pano.png"), str(tmp_path / "depth.npy"), None, 64)
    panorama, fitted = with_distance(input_panorama(config), Stages())
    assert not fitted and np.isfinite(panorama.distance).all()
    known = np.repeat(np.repeat(np.isfinite(distance) & (distance > 0), 2, 0), 2, 1)
    np.testing.assert_array_equal(panorama.valid, known)
    np.testing.assert_array_equal(np.asarray(panorama.distance)[known], 2.0)


def test_a_photograph_alone_gets_a_fitted_room(tmp_path):
    config, stages = InputConfig(str(SAMPLES / "hotel_room.jpg"), None, None, 64), Stages()
    shell = dataclasses.replace(stages.shell, climbers=32, rounds=4)
    stages = dataclasses.replace(stages, shell=shell, depth=DepthConfig(method="shell"))
    panorama, fitted = with_distance(input_panorama(config), stages)
    assert fitted
    # Straight down is the camera's height exactly, whatever the fit; the nearest row is 1.4 degrees off.
    np.testing.assert_allclose(panorama.distance[-1], 1.6, rtol=1e-3)
