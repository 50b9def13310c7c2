"""What Blender renders against the room's analytic shell. Needs bpy: name its Python in REIN3D_BLENDER_PYTHON."""

import importlib.util
import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from experiments.render_rooms.blender_process import BlenderProcess
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
    lamp = {"kind": "point", "place": [1.0, 2.0, 2.0], "power": 50.0, "colour": [1, 1, 1], "radius": 0.1}
    return {
        "seed": 1, "models": [], "materials": {"all": grey}, "lights": [lamp],
        "faces": [{"material": "all", "corners": face.corners.tolist()} for face in shell_faces(plan, names)],
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
