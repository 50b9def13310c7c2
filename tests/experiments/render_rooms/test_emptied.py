"""Rooms seen without furniture: what is left out, and that only finished rooms of this very plan are drawn again."""

import copy
import json

import pytest

from experiments.render_rooms.emptied import emptied_plan, missing_emptied
from experiments.render_rooms.layout import ShotList, plan_room
from tests.experiments.render_rooms.catalogs import paper_catalog

CATALOG = paper_catalog()
FLAT = {"rug", "mirror", "picture_frame", *(f"picture{i}" for i in range(4))}
HANGING = {"curtain", "blind"}
SHELL = {"floor", "ceiling", "wall", "accent", "frame", "skirting", "window", "sill", "door"}
THIN = 0.03  # metres: thicker than a rug or a framed picture, thinner than anything that stands


@pytest.fixture(scope="module")
def rooms():
    return [plan_room(seed, CATALOG, ShotList()) for seed in range(24)]


def _record(plan):
    """What the renderer writes as room.json."""
    told = json.loads(json.dumps({key: value for key, value in plan.items() if key != "faces"}))
    for number, panorama in enumerate(told["panoramas"]):
        panorama |= {"seconds": 1.5, "gains": [1.0 + number, 1.0, 0.5]}
    return told


def test_parts_follow_from_what_faces_are_of(rooms):
    by_material = {}
    for face in (face for room in rooms for face in room["faces"]):
        by_material.setdefault(face["material"], set()).add(face["part"])
    assert {name for name, found in by_material.items() if "flat" in found} <= FLAT
    assert all(by_material[name] == {"flat"} for name in FLAT & set(by_material))
    assert all(by_material[name] == {"furniture"} for name in HANGING & set(by_material))
    assert all(by_material[name] == {"room"} for name in SHELL & set(by_material))
    assert by_material["lit"] == {"room", "furniture"}  # panels in the ceiling stay, bare bulbs go


def test_what_is_flat_lies_close_to_floor_or_wall(rooms):
    for room in rooms:
        for face in (face for face in room["faces"] if face["material"] == "rug"):
            assert all(0 <= z < THIN for _, _, z in face["corners"])


def test_an_emptied_plan_is_the_room_with_the_gains_that_were_used(rooms):
    plan = plan_room(3, CATALOG, ShotList(views=2, fine_height=256, walk_frames=9))
    assert len(plan["panoramas"]) > 3
    emptied = emptied_plan(plan, _record(plan))
    assert [panorama["name"] for panorama in emptied["panoramas"]] == ["000", "001"]
    assert [panorama["gains"][0] for panorama in emptied["panoramas"]] == [1.0, 2.0]
    assert emptied["faces"] == plan["faces"]
    assert "gains" not in plan["panoramas"][0]  # the plan is left as it was


@pytest.mark.parametrize("changed", ["pose", "model", "look", "count"])
def test_a_room_that_was_planned_otherwise_is_not_drawn(rooms, changed):
    record = copy.deepcopy(_record(rooms[0]))
    if changed == "pose":
        record["panoramas"][0]["yaw"] += 1e-6
    elif changed == "model":
        record["models"][0]["place"][0] += 1e-6
    elif changed == "look":
        record["look"]["stops"] += 1e-6
    else:
        record["panoramas"].pop()
    assert emptied_plan(rooms[0], _record(rooms[0])) is not None
    assert emptied_plan(rooms[0], record) is None


def test_a_part_is_lacking_until_every_still_has_its_files(tmp_path):
    for name in (
        "000.npz",
        "001.npz",
        "000_fine.npz",
        "walk_000.npz",
        "000_empty.npz",
        "000_empty.png",
        "000_exit.npz",
    ):
        (tmp_path / name).touch()
    for name, lacking in (
        ("001_empty.npz", ("empty", "exit")),
        ("001_empty.png", ("exit",)),
        ("001_exit.npz", ()),
    ):
        (tmp_path / name).touch()
        assert missing_emptied(tmp_path) == lacking
    (tmp_path / "000_empty.png").unlink()
    assert missing_emptied(tmp_path) == ("empty",)
