"""Rooms as planned: reproducible, free of collisions, openings in their walls, cameras in free air, credits named."""

import json

import numpy as np
import pytest

from experiments.render_rooms.arrangement import Arrangement
from experiments.render_rooms.floorplan import Floorplan, draw_floorplan
from experiments.render_rooms.layout import ShotList, plan_room
from experiments.render_rooms.polygon import edge_frame, inside, is_simple, overlap, polygon_area, rectangle
from experiments.render_rooms.shell import floorplan_distance, is_in_room, shell_faces
from experiments.render_rooms.styles import STYLES, furnish
from tests.experiments.render_rooms.catalogs import paper_catalog

SEEDS = range(24)
CATALOG = paper_catalog()


@pytest.fixture(scope="module")
def rooms():
    return [plan_room(seed, CATALOG, ShotList(walk_frames=9)) for seed in SEEDS]


@pytest.mark.slow
def test_a_seed_is_one_room_for_ever(rooms):
    assert json.dumps(plan_room(3, CATALOG, ShotList(walk_frames=9))) == json.dumps(rooms[3])
    assert len({json.dumps(room["corners"]) for room in rooms}) == len(rooms)


def test_finer_or_more_panoramas_leave_the_room_as_it_is(rooms):
    other = plan_room(5, CATALOG, ShotList(views=3, height=64, fine_height=128))
    assert other["corners"] == rooms[5]["corners"]
    assert [p["name"] for p in other["panoramas"]][-1] == "000_fine"


def test_floors_are_simple_and_of_plausible_size(rooms):
    for room in rooms:
        corners = np.array(room["corners"])
        assert is_simple(corners)
        assert 3 < polygon_area(corners) < 100
        assert np.all(np.ptp(corners, axis=0) > 1.9)


def test_openings_stay_in_their_walls_and_apart():
    for seed in SEEDS:
        plan = draw_floorplan(np.random.default_rng(seed), (5.0, 4.0), True)
        for opening in plan.openings:
            length = edge_frame(plan.corners, opening.edge)[3]
            assert opening.start > 0.1
            assert opening.start + opening.width < length - 0.1
            others = [o for o in plan.openings if o.edge == opening.edge and o is not opening]
            assert all(o.start > opening.start + opening.width or o.start + o.width < opening.start for o in others)


def test_rooms_beyond_doors_overlap_nothing():
    for seed in SEEDS:
        plan = draw_floorplan(np.random.default_rng(seed), (6.0, 5.0), True)
        for annex in plan.annexes:
            points = np.random.default_rng(0).uniform(annex.corners.min(0), annex.corners.max(0), (500, 2))
            assert not np.any(inside(plan.corners, points[inside(annex.corners, points)]))


def test_furniture_stands_inside_and_nothing_stands_in_a_doorway():
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        arrangement = Arrangement(rng, CATALOG, draw_floorplan(rng, (5.0, 4.5), True))
        furnish(arrangement, list(STYLES)[seed % len(STYLES)])
        for piece in arrangement.placed:
            assert np.all(inside(arrangement.plan.corners, piece.footprint * 0.999 + piece.centre * 0.001))
            doors = [area for area, low, _ in arrangement.clear if low < 0.1]
            assert piece.base > 0.1 or not any(overlap(piece.footprint, area) for area in doors)


def test_pieces_at_walls_look_into_the_room():
    rng = np.random.default_rng(1)
    square = Floorplan(np.array([[0, 0], [4, 0], [4, 4], [0, 4]], float), np.array([[0, 0, 2.5]]))
    arrangement = Arrangement(rng, CATALOG, square)
    piece, edge, _ = arrangement.against_wall("sofa")
    front = piece.to_room((0, -1)) - piece.centre
    assert front @ edge_frame(square.corners, edge)[2] == pytest.approx(1)
    assert np.min(np.abs(piece.footprint - np.array([[0, 0]]))) < 0.06 or np.max(piece.footprint) > 3.94


def test_two_pieces_on_one_place_are_one_too_many():
    square = Floorplan(np.array([[0, 0], [4, 0], [4, 4], [0, 4]], float), np.array([[0, 0, 2.5]]))
    arrangement = Arrangement(np.random.default_rng(0), CATALOG, square)
    model = CATALOG.models["sofa"][0]
    assert arrangement.put(model, np.array([2, 2]), 0.3) is not None
    assert arrangement.put(model, np.array([2.2, 2.4]), 0.9) is None
    assert not arrangement.is_free(rectangle(np.array([2, 2]), (0.1, 0.1), 0), 0.1, 0.2)


def test_cameras_are_in_free_air(rooms):
    for room in rooms:
        plan = Floorplan(np.array(room["corners"]), np.array(room["ceiling"]))
        for panorama in room["panoramas"]:
            place = np.array(panorama["place"])
            assert is_in_room(plan, place)
            assert 0.7 < panorama["camera_height"] <= 2.2
            assert np.allclose(np.array(panorama["room_from_panorama"])[:3, 3], place)
            for model in room["models"]:
                if model["place"][2] < place[2] and model["size"][2] > 0.03:
                    area = rectangle(np.array(model["place"][:2]), tuple(model["size"][:2]), model["yaw"])
                    assert not inside(area, place[None, :2])[0]


def test_walks_are_straight_and_evenly_spaced(rooms):
    walks = [[np.array(p["place"]) for p in room["panoramas"] if p["name"].startswith("walk")] for room in rooms]
    assert sum(map(bool, walks)) > 5
    for walk in filter(None, walks):
        steps = np.diff(walk, axis=0)
        assert np.allclose(steps, steps[0], atol=1e-9)
        assert np.linalg.norm(steps[0]) == pytest.approx(0.1)


def test_every_face_has_its_material_and_every_model_its_credit(rooms):
    for room in rooms:
        assert {face["material"] for face in room["faces"]} <= set(room["materials"])
        assert len(room["credits"]) >= 2
        makers = {credit[0] for credit in room["credits"]}
        assert {model["key"].split(":")[1] for model in room["models"]} <= makers


def test_the_shell_is_closed_up_to_its_openings():
    """The area of a box's faces: walls, floor and ceiling less the hole."""
    rng = np.random.default_rng(4)
    plan = Floorplan(np.array([[0, 0], [4, 0], [4, 3], [0, 3]], float), np.array([[0, 0, 2.5]]))
    faces = shell_faces(plan, dict.fromkeys(("floor", "ceiling", "wall", "accent", "frame"), "all"))
    assert sum(_area(face.corners) for face in faces) == pytest.approx(2 * 12 + 2 * 2.5 * 7)
    directions = rng.normal(size=(200, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    origin = np.array([1.0, 1.2, 1.5])
    hits = origin + floorplan_distance(plan, origin, directions)[:, None] * directions
    gaps = np.concatenate([hits, np.array([4, 3, 2.5]) - hits], axis=1)
    assert np.all(gaps > -1e-9)
    assert np.allclose(gaps.min(1), 0, atol=1e-9)


def _area(corners):
    return 0.5 * np.linalg.norm(np.sum(np.cross(corners, np.roll(corners, -1, axis=0)), axis=0))
