"""Folders to hand over: what their README.txt names is there, in the axes that it says."""

import json
import re
import zipfile

import numpy as np
import plyfile
import pytest
import trimesh

from experiments.export import __main__ as export
from experiments.export import hand_over
from experiments.run_folder import open_run
from rein3d_jax.io.splats.gaussian_file import read_splats
from rein3d_jax.io.splats.up_axis import with_up
from rein3d_jax.lift.detail_order import in_detail_order


@pytest.fixture(scope="module")
def handed(run_folder, tmp_path_factory):
    """All six, of a run whose viewer.html is one word; coarse meshes."""
    output = tmp_path_factory.mktemp("handed")
    (run_folder / "viewer.html").write_text("viewer")
    try:
        arguments = [str(run_folder), "--to", *hand_over.TARGETS, "--output", str(output), "--voxel", "0.15"]
        assert export.main(arguments) == 0
    finally:
        (run_folder / "viewer.html").unlink()
    return output


@pytest.mark.parametrize("target", hand_over.TARGETS)
def test_the_note_names_every_file_and_no_other(handed, target):
    note = (handed / target / "README.txt").read_text()
    there = {path.name for path in (handed / target).iterdir()} - {"README.txt"}
    listed = set(re.findall(r"^(\w+\.\w+) ", note, re.MULTILINE))
    assert listed == there and "{" not in note
    assert "1.40 m" in note or target == "unity"  # the room's floor
    assert "ot tried" in note or target == "web"


def test_axes_are_those_that_the_notes_say(handed, run_folder):
    scene = open_run(run_folder).refined
    for target, up, words in (("unity", "y", "Y up"), ("unreal", "z", "Z up"), ("blender", "z", "Z up")):
        path = handed / target / "scene.ply"
        assert plyfile.PlyData.read(path).comments[0] == f"{words}, metres, right-handed"
        np.testing.assert_array_equal(read_splats(path).means, with_up(in_detail_order(scene), up).means)


def test_unity_s_mirrored_splats_lie_in_the_collider(handed, room):
    """Scale -1 1 1 does to the PLY what glTFast does to the GLB: X is mirrored."""
    mesh = trimesh.load(handed / "unity" / "collider.glb", force="mesh", process=False)
    low, high = mesh.bounds
    means = read_splats(handed / "unity" / "scene.ply").means
    inside = ((means > low - 0.2) & (means < high + 0.2)).all(axis=1)
    assert inside.mean() > 0.99 and high[1] == pytest.approx(room.walls[2], abs=0.2)  # both have Y up


def test_without_a_viewer_the_web_s_folder_is_refused(run_folder, tmp_path, capsys):
    assert export.main([str(run_folder), "--to", "web", "--output", str(tmp_path)]) == 2
    assert "viewer.html" in capsys.readouterr().err and not (tmp_path / "web" / "README.txt").exists()


def test_a_headset_gets_no_more_than_its_budget(run_folder, tmp_path, monkeypatch):
    monkeypatch.setattr(hand_over, "HEADSET_BUDGET", 500)
    (run_folder / "viewer.html").write_text("viewer")
    try:
        assert export.main([str(run_folder), "--to", "headset", "--output", str(tmp_path)]) == 0
    finally:
        (run_folder / "viewer.html").unlink()
    with zipfile.ZipFile(tmp_path / "headset" / "scene.sog") as archive:
        assert json.loads(archive.read("meta.json"))["count"] == 500
