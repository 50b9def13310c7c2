"""What Blender renders against the room's analytic shell. Needs bpy: name its Python in REIN3D_BLENDER_PYTHON."""

import importlib.util
import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from experiments.render_rooms.blender_process import BlenderProcess
from experiments.render_rooms.fittings import prism
from experiments.render_rooms.floorplan import Floorplan, Opening
from experiments.render_rooms.shell import floorplan_distance, shell_faces
from experiments.render_rooms.viewpoints import panorama_rays

_HERE = sys.executable if importlib.util.find_spec("bpy") else ""
PYTHON = Path(os.environ.get("REIN3D_BLENDER_PYTHON", _HERE) or "/nowhere")
pytestmark = pytest.mark.skipif(not PYTHON.exists(), reason="no Python with bpy; name one in REIN3D_BLENDER_PYTHON")

ELL = np.array([[0, 0], [4, 0], [4, 2.5], [2.2, 2.5], [2.2, 5], [0, 5]], float)
PLAN = Floorplan(ELL, np.array([[0, 0, 2.6], [-0.5, 0, 3.6]]))
PLACE, YAW = [1.3, 1.7, 1.5], 0.7
ATOL = 2e-3  # metres: pixels are met within 0.5 % of their centre, at distances up to 5 m


def _plan(plan):
    grey = {"kind": "plain", "colour": [0.5, 0.5, 0.5], "roughness": 0.8}
    names = {name: "all" for name in ("floor", "ceiling", "wall", "accent", "frame")}
    faces = [{"material": "all", "corners": f.corners.tolist(), "part": "room"} for f in shell_faces(plan, names)]
    lamp = {"kind": "point", "place": [1.0, 2.0, 2.0], "power": 50.0, "colour": [1, 1, 1], "radius": 0.1}
    return {
        "seed": 1, "models": [], "materials": {"all": grey}, "lights": [lamp],
        "faces": faces,
        "panoramas": [{"name": "000", "height": 32, "place": PLACE, "yaw": YAW}],
        "look": {"stops": 0.0, "shoulder": 0.5, "balance": 0.5, "saturation": 1.0},
        "world": {"image": "city", "turn": 0.0, "strength": 1.0},
    }  # fmt: skip


@pytest.fixture(scope="module")
def rendered(tmp_path_factory):
    """Distances of the closed room, of the same with a window, and of the closed one again."""
    folder = tmp_path_factory.mktemp("rooms")
    window = Opening(5, 1.0, 1.5, 0.9, 2.0, "window", 0.2)
    blender = BlenderProcess(PYTHON, folder / "log")
    for name, plan in (("shut", PLAN), ("open", replace(PLAN, openings=(window,))), ("again", PLAN)):
        answer = blender.draw(_plan(plan), folder / name, {"samples": 2, "bounces": 1})
        assert answer.startswith("done"), (folder / "log").read_text()[-2000:]
    blender.stop()
    return folder


def test_distance_is_that_of_the_analytic_walls(rendered):
    distance = np.load(rendered / "shut" / "000.npz")["distance"]
    truth = floorplan_distance(PLAN, np.array(PLACE), panorama_rays(32, YAW))
    wrong = np.abs(distance - truth) > ATOL * np.maximum(1, truth)
    assert wrong.mean() < 0.005  # a ray on the very corner may see either wall
    assert np.all(distance > 0)


def test_the_camera_looks_through_furniture_whose_shadow_stays(tmp_path):
    """A slab before the closed room's wall: gone from the distance, and still dark behind; without it, all is equal."""
    base = np.array([[0.0, 1.0], [0.6, 1.0], [0.6, 2.4], [0.0, 2.4]])
    furnished = _plan(PLAN)
    furnished["faces"] += [
        {"material": "all", "corners": face.corners.tolist(), "part": "furniture"}
        for face in prism("all", base, 0.01, 1.6)
    ]
    for plan in (furnished, bare := _plan(PLAN)):
        plan["panoramas"][0]["gains"] = [1.0, 1.0, 1.0]
    blender = BlenderProcess(PYTHON, tmp_path / "log")
    for name, plan, emptied in (("full", furnished, []), ("empty", furnished, ["empty"]), ("bare", bare, ["empty"])):
        settings = {"samples": 16, "bounces": 1, "emptied": emptied}
        assert blender.draw(plan, tmp_path / name, settings).startswith("done")
    blender.stop()
    full = np.load(tmp_path / "full" / "000.npz")["distance"]
    empty, without = (np.load(tmp_path / name / "000_empty.npz") for name in ("empty", "bare"))
    hidden = full < without["distance"] - 0.01
    assert 20 < hidden.sum() < hidden.size / 2
    assert np.array_equal(empty["distance"], without["distance"])
    assert np.array_equal(empty["distance"][~hidden], full[~hidden])
    assert np.median(empty["linear"][hidden]) < 0.5 * np.median(without["linear"][hidden])


def _write_cube(path, clear):
    """A unit cube whose front is a pane that lets all but 1 - `clear` through."""
    path.with_suffix(".mtl").write_text(f"newmtl wood\nKd 0.5 0.5 0.5\nnewmtl pane\nKd 0.5 0.5 0.5\nd {1 - clear}\n")
    corners = [f"v {x} {y} {z}" for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    wood = ["f 1 2 4 3", "f 5 7 8 6", "f 1 5 6 2", "f 3 4 8 7", "f 1 3 7 5"]
    lines = [f"mtllib {path.stem}.mtl", *corners, "usemtl wood", *wood, "usemtl pane", "f 2 6 8 4"]
    path.write_text("\n".join(lines) + "\n")


@pytest.mark.parametrize("clear", [0.0, 1.0])
def test_exit_is_the_far_side_of_the_box_that_is_met(tmp_path, clear):
    """A turned and stretched box against the slabs that bound it; where its front is clear too."""
    _write_cube(tmp_path / "cube.obj", clear)
    centre, yaw, size = np.array([1.2, 0.6, 0.4]), 0.5, np.array([0.9, 0.4, 1.2])
    plan = _plan(PLAN)
    plan["models"] = [
        {"key": "cube", "path": str(tmp_path / "cube.obj"), "place": centre.tolist(), "yaw": yaw + np.pi,
         "size": size.tolist(), "full_size": [1.0, 1.0, 1.0], "rotation": None, "recolour": [0.0, 1.0, 1.0]}
    ]  # fmt: skip
    plan["panoramas"][0] |= {"gains": [1.0, 1.0, 1.0], "height": 64}
    blender = BlenderProcess(PYTHON, tmp_path / "log")
    for folder, parts in (("full", []), ("exit", ["exit"])):
        settings = {"samples": 2, "bounces": 1, "emptied": parts, "furnished": str(tmp_path / "full")}
        assert blender.draw(plan, tmp_path / folder, settings).startswith("done"), (tmp_path / "log").read_text()
    blender.stop()
    assert [path.name for path in (tmp_path / "exit").iterdir()] == ["000_exit.npz"]
    leave = np.load(tmp_path / "exit" / "000_exit.npz")["exit"]
    distance = np.load(tmp_path / "full" / "000.npz")["distance"]
    turn = np.array([[np.cos(yaw), np.sin(yaw), 0], [-np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    rays, start = panorama_rays(64, YAW) @ turn.T, turn @ (np.array(PLACE) - centre - [0, 0, size[2] / 2])
    sides = np.stack([(-size / 2 - start) / rays, (size / 2 - start) / rays])
    near, far = sides.min(0).max(-1), sides.max(0).min(-1)
    hit = (near < far) & (near > 0)
    assert 50 < hit.sum() < hit.size / 2
    assert np.mean((leave > 0) != hit) < 0.005  # a ray along an edge may go either way
    met = (leave > 0) & hit
    assert np.all(np.abs(leave - far)[met & (far - near > 0.01)] < ATOL)
    assert np.all(leave[met] >= distance[met] - ATOL)
    assert np.mean(distance[met] > near[met] + 0.01) >= 0.3 * clear  # through a clear front the back is seen


def test_through_a_window_there_is_nothing(rendered):
    distance = np.load(rendered / "open" / "000.npz")["distance"]
    shut = np.load(rendered / "shut" / "000.npz")["distance"]
    rays = panorama_rays(32, YAW)
    hit = np.array(PLACE) + shut[..., None] * rays
    centre = (np.abs(hit[..., 0]) < 0.01) & (np.abs(hit[..., 1] - 3.25) < 0.5) & (np.abs(hit[..., 2] - 1.45) < 0.3)
    assert centre.sum() > 5
    assert np.all(distance[centre] == 0)
    assert np.mean(distance == 0) < 0.1


def test_the_same_room_gives_the_same_bytes_and_a_sane_exposure(rendered):
    first, again = (np.load(rendered / name / "000.npz") for name in ("shut", "again"))
    assert np.array_equal(first["distance"], again["distance"])
    assert np.array_equal(first["linear"], again["linear"])
    assert 0.05 < np.median(first["linear"]) < 0.6
    assert (rendered / "shut" / "000.png").stat().st_size > 500
    assert (rendered / "shut" / "room.json").exists()
