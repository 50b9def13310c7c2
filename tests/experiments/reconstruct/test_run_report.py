"""What the report of a run says: sliders, warnings in plain words, where it stands, whose pictures; all of it text."""

import dataclasses
import re

import cv2
import html5lib
import numpy as np
import OpenImageIO as oiio
import pytest

from experiments.reconstruct.inputs import SAMPLES, InputConfig
from experiments.reconstruct.pages import viewer_page as viewer
from experiments.reconstruct.pages.run_report import longest, run_report
from experiments.reconstruct.pages.sources import sources
from experiments.reconstruct.pages.viewer_page import viewer_page
from experiments.reconstruct.run import Pictures, Run
from experiments.run_folder import open_run
from rein3d_jax.depth.estimate import DepthConfig
from rein3d_jax.depth.level import unasked_lean
from rein3d_jax.geometry.poses import pinhole_camera, upright
from rein3d_jax.io.rooms.traced_room import View
from rein3d_jax.pipeline.reconstruct import ALL_PATHS, Decisions, Reconstruction
from rein3d_jax.rasterize import Buffers
from rein3d_jax.refine import Curves
from rein3d_jax.refine.refine import ALL_STEPS
from rein3d_jax.report.report import Comparison, render_report

HOSTILE = "<script>alert(1)</script> \"quoted\" & 'single'"
FILE = "<img src=x onerror=alert(1)> & 'quoted'.png"  # no slash, which a file's name cannot have
PICTURE = np.full((32, 32, 3), 0.5, np.float32)


METRICS = {
    "seconds": {"read": 1.0, "lift": 2.0, "refine": 30.0, "write": 9.0, "total": 42.0},
    "count": {"pixels": 8192, "lift": 8192, "refined": 9000},
    "overflows": {"explore.max_frames": 0, "lift.capacity": 0, "refine.spare": 0},
    "skipped_steps": 0,
    "coverage": {"coarse": 0.95, "refined": 1.0},
    "quality": {name: {"psnr": 20.0, "ssim": 0.7, "views": 1} for name in ("coarse", "refined")},
}


@pytest.fixture(scope="module")
def run(run_folder):
    """A run with one novel view, whose names a hostile file could have."""
    found = open_run(run_folder)
    named = InputConfig(panorama=f"somewhere/{FILE}", distance=None, views=None)
    curves = Curves(*[np.zeros((0, 2))] * 3, *[np.zeros(())] * 3)
    decisions = Decisions((0.1, 0.1), ALL_PATHS, ALL_STEPS, 0)
    scenes = (found.coarse, found.trajectories, tuple(found.videos()), found.refined)
    result = Reconstruction(found.panorama, *scenes, curves, decisions, Buffers(64, 64, 64, 64))
    view = View(HOSTILE, PICTURE, pinhole_camera(upright(np.array([0.5, 0, 0])), 32, 1.5))
    return Run(dataclasses.replace(found.config, input=named), result, False, "", [view], unasked_lean())


def report(run, **changes):
    """The run's report, some of its metrics changed."""
    paths = longest(run.result.trajectories)
    ends = [np.asarray(run.result.videos[index].rgb[-1]) for index in paths]
    return run_report(run, Pictures(ends, ends, [PICTURE], [PICTURE]), {**METRICS, **changes})


def test_every_shown_path_and_view_has_a_slider(run):
    parts = [part for part in report(run).parts if isinstance(part, Comparison)]
    assert len(parts) == len(longest(run.result.trajectories)) + 1
    for part in parts:  # a divider needs two pictures of a size
        sizes = {cv2.imdecode(np.frombuffer(p.data, np.uint8), 1).shape for p in (part.before, part.after)}
        assert len(sizes) == 1


def test_the_page_is_valid_and_names_are_text(run):
    page = render_report(report(run))
    html5lib.HTMLParser(strict=True).parse(page)
    assert "<script" not in page and "<img src=x" not in page
    assert "&lt;script&gt;" in page and "&lt;img src=x" in page  # the view's name, and the picture's


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"coverage": {"coarse": 0.6, "refined": 1.0}}, "40% .* was hidden from the panorama and is a guess"),
        ({"coverage": {"coarse": 0.8, "refined": 0.9}}, "10% .* is empty"),
        ({"overflows": {"lift.capacity": 1234}}, "capacity was reached: 1,234 Gaussians .* raise lift.capacity"),
        ({"overflows": {"explore.max_frames": 3}}, "3 frames .* raise explore.max_frames"),
        ({"skipped_steps": 2}, "2 refinement steps"),
    ],
)
def test_warnings_in_plain_words(run, changes, words):
    assert not report(run).warnings
    (warning,) = report(run, **changes).warnings
    assert re.search(words, warning)


def test_a_guessed_scale_is_told(run):
    found = report(dataclasses.replace(run, estimated=True))
    assert any("scale is a guess" in warning and "input.camera_height" in warning for warning in found.warnings)
    assert "depth network's estimate" in found.distance_origin
    boxed = dataclasses.replace(run.config, depth=DepthConfig(method="shell"))
    found = report(dataclasses.replace(run, estimated=True, config=boxed))
    assert "room-shell estimate" in found.distance_origin
    assert any("furniture will look flat" in warning for warning in found.warnings)


def test_what_was_done_to_a_given_map_is_told(run):
    assert report(run).distance_origin == "given with the panorama."
    relative = dataclasses.replace(run.config.input, distance_kind="relative")
    scaled = dataclasses.replace(
        run, converted="multiplied by 2", config=dataclasses.replace(run.config, input=relative)
    )
    assert report(scaled).distance_origin == "given with the panorama: multiplied by 2."
    assert any("scale is a guess" in warning for warning in report(scaled).warnings)
    measured = dataclasses.replace(relative, camera_height=1.5)
    assert not report(dataclasses.replace(scaled, config=dataclasses.replace(run.config, input=measured))).warnings


def test_a_run_stands_among_what_was_measured(run):
    (own,) = [mark for mark in report(run).standing.marks if mark.own]
    assert (own.cost, own.merit) == (33.0, 20.0)  # from the panorama to the scene, nothing of what is written after
    paths, blind = longest(run.result.trajectories), {k: v for k, v in METRICS.items() if k != "quality"}
    ends = [np.asarray(run.result.videos[index].rgb[-1]) for index in paths]
    found = run_report(run, Pictures(ends, ends, [PICTURE], [PICTURE]), blind)
    (own,) = [mark for mark in found.standing.marks if mark.own]
    assert own.merit is None and "no truth" in own.label


def test_every_sample_has_a_credit():
    said = " ".join(sources("sample:room/input.png"))
    for name in ("Scopia", "BlendSwap-CC-BY", "KatorLegaz", "BlendSwap-CC-0", "CC-BY 3.0", "CC-BY 3.0 US", "CC0"):
        assert name in said
    samples = {path.name for path in SAMPLES.iterdir() if path.suffix not in (".md", ".toml")}
    assert samples and all(sources(f"sample:{name}") for name in samples)


def test_the_credit_of_ones_own_picture_is_shown(tmp_path):
    spec = oiio.ImageSpec(32, 16, 3, "uint8")
    spec.attribute("Copyright", f"(c) {HOSTILE}\n" + "x" * 999)
    spec.attribute("Artist", "Somebody")
    out = oiio.ImageOutput.create(str(tmp_path / "a.jpg"))
    assert out.open(str(tmp_path / "a.jpg"), spec) and out.write_image(np.zeros((16, 32, 3), np.uint8)) and out.close()
    (said,) = sources(str(tmp_path / "a.jpg"))
    assert "a.jpg. The file says: Somebody; (c) <script>" in said and "\n" not in said and len(said) < 600
    cv2.imwrite(str(tmp_path / "b.png"), np.zeros((16, 32, 3), np.uint8))
    assert "names no author and no licence" in sources(str(tmp_path / "b.png"))[0]


def test_doubt_is_shown_where_there_is_any(run):
    assert "picture of doubt" not in render_report(report(run)) and "third picture is doubt" not in render_report(
        report(run)
    )
    panorama = run.result.panorama
    half = panorama.replace(doubt=np.where(np.arange(panorama.doubt.shape[1]) % 2, 0.5, 0.0) + 0 * panorama.doubt)
    doubtful = dataclasses.replace(run, result=run.result.replace(panorama=half))
    assert abs(doubtful.in_doubt - 0.5) < 1e-6  # every second column
    page = render_report(report(doubtful))
    assert "third picture is doubt" in page and "for 50% of the panorama" in page


def test_a_page_that_would_be_too_large_shows_a_lighter_refined_scene_alone(run, monkeypatch):
    whole = viewer_page(run)
    assert len(whole.encode()) + viewer._LARGEST * 4 / 3 < 25e6  # base64, beside the page's own code
    assert {"Coarse", "Refined"} <= set(re.findall(r'"name": "(\w+)"', whole))
    monkeypatch.setattr(viewer, "_LARGEST", 20_000)
    small = viewer_page(run)
    assert re.findall(r'"name": "(\w+)"', small) == ["Refined"]
    (scene,) = re.findall(r'"spz": "([^"]*)"', small)
    assert 12_000 < len(scene) * 3 / 4 <= 20_000  # base64
