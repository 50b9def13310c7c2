"""Structured3D and a folder of one's own: values, metres, where the centre looks, order, laziness; and every fault."""

import json

import cv2
import numpy as np
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.geometry.poses import upright
from rein3d_jax.geometry.sphere import rays_of_pose
from rein3d_jax.io.pictures.distance import write_distance_exr
from rein3d_jax.io.pictures.image import write_rgb
from rein3d_jax.io.rooms import posed_panorama
from rein3d_jax.io.rooms.panorama_folder import read_folder
from rein3d_jax.io.rooms.structured3d import read_rooms

SHAPE = (16, 32)
RED = np.array([1.0, 0.0, 0.0])
RNG = np.random.default_rng(0)
MILLIMETRES = RNG.integers(500, 9000, SHAPE).astype(np.uint16)
MILLIMETRES[3, 4] = 0


def picture(column=16):
    """Grey with a red mark on the horizon in `column`."""
    rgb = np.full((*SHAPE, 3), 0.4)
    rgb[8, column] = RED
    return rgb


def write_room(root, scene="scene_00000", room="485142", camera="1000.0 -2500.0 1600.0\n"):
    folder = root / scene / "2D_rendering" / room / "panorama"
    for furnishing in ("full", "empty"):
        (folder / furnishing).mkdir(parents=True)
        rgba = np.dstack([picture()[..., ::-1] * 255, np.full(SHAPE, 255)]).astype(np.uint8)
        cv2.imwrite(str(folder / furnishing / "rgb_rawlight.png"), rgba)
        cv2.imwrite(str(folder / furnishing / "depth.png"), MILLIMETRES)
    (folder / "camera_xyz.txt").write_text(camera)
    return folder


def refused(message, read, *arguments, **options):
    with pytest.raises(InputError, match=message) as caught:
        list(read(*arguments, **options))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("yaw", [0.0, 1.0, -2.5])
def test_rays_and_poses_are_those_of_geometry(yaw):
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    pose = posed_panorama.pose_of_turn(turn, np.array([1.0, 2.0, 3.0]))
    np.testing.assert_allclose(pose, upright(np.array([1.0, 2.0, 3.0]), yaw), atol=1e-6)  # float32 there
    np.testing.assert_allclose(posed_panorama.rays_of_pose(pose, 8), rays_of_pose(pose, 8, 16), atol=1e-6)


def test_structured3d_values_and_frame(tmp_path):
    write_room(tmp_path)
    (room,) = read_rooms(tmp_path)
    assert room.name == "scene_00000/485142" and room.panorama.rgb.shape == (*SHAPE, 3)
    np.testing.assert_allclose(room.panorama.distance, MILLIMETRES / 1000, rtol=1e-6)  # float32
    np.testing.assert_array_equal(room.panorama.valid, MILLIMETRES > 0)
    np.testing.assert_allclose(room.world_from_camera[:3, 3], [1.0, -2.5, 1.6])
    rays = posed_panorama.rays_of_pose(room.world_from_camera, 16)
    marked = np.argwhere((np.asarray(room.panorama.rgb) == RED).all(-1))
    np.testing.assert_array_equal(marked, [[8, 16]])
    # The mark is half a pixel right of the centre, which looks along +Y, and half a pixel below the horizon.
    half = np.pi / 32
    np.testing.assert_allclose(rays[8, 16], [np.sin(half) * np.cos(half), np.cos(half) ** 2, -np.sin(half)], atol=1e-9)


def test_structured3d_in_order_and_lazily(tmp_path):
    for scene, room in (("scene_00010", "7"), ("scene_00002", "9"), ("scene_00002", "12")):
        write_room(tmp_path, scene, room)
    names = [room.name for room in read_rooms(tmp_path, furnishing="empty", height=32)]
    assert names == ["scene_00002/12", "scene_00002/9", "scene_00010/7"]
    assert [room.name for room in read_rooms(tmp_path / "scene_00010")] == ["scene_00010/7"]
    (tmp_path / "scene_00010/2D_rendering/7/panorama/full/depth.png").unlink()
    rooms = read_rooms(tmp_path)
    assert next(rooms).name == "scene_00002/12" and next(rooms).name == "scene_00002/9"
    refused(r"7/panorama/full/depth.png cannot be read", lambda: rooms)


def test_structured3d_resized(tmp_path):
    write_room(tmp_path)
    (room,) = read_rooms(tmp_path, height=8)
    assert room.panorama.rgb.shape == (8, 16, 3) and room.panorama.distance.shape == (8, 16)


def test_structured3d_faults(tmp_path):
    refused("holds no scene_XXXXX", read_rooms, tmp_path)
    refused("light 'blue' must be one of raw, warm, cold", read_rooms, tmp_path, light="blue")
    refused("furnishing 'half' must be", read_rooms, tmp_path, furnishing="half")
    folder = write_room(tmp_path)
    refused("rgb_warmlight.png cannot be read", read_rooms, tmp_path, light="warm")
    for text in ("", "1 2", "1 2 x", "1 2 nan", "\0\xff"):
        (folder / "camera_xyz.txt").write_text(text)
        refused("camera_xyz.txt must hold three numbers", read_rooms, tmp_path)
    (folder / "camera_xyz.txt").unlink()
    refused("camera_xyz.txt cannot be read", read_rooms, tmp_path)
    (folder / "camera_xyz.txt").write_text("0 0 0")
    cv2.imwrite(str(folder / "full/depth.png"), MILLIMETRES[:8])
    refused(r"depth.png has 8 x 32 values", read_rooms, tmp_path)
    cv2.imwrite(str(folder / "full/depth.png"), MILLIMETRES.astype(np.uint8))
    refused(r"depth.png is no distance map", read_rooms, tmp_path)


DISTANCE = MILLIMETRES.astype(np.float32) / 1000


def write_folder(folder):
    write_rgb(folder / "b.png", picture())
    write_distance_exr(folder / "b_distance.exr", DISTANCE)
    write_rgb(folder / "a.jpg", picture())
    cv2.imwrite(str(folder / "a_distance.png"), MILLIMETRES)
    cv2.imwrite(str(folder / "c.hdr"), picture().astype(np.float32))
    np.save(folder / "c_distance.npy", DISTANCE)
    return folder


def test_folder_of_every_format(tmp_path):
    a, b, c = read_folder(write_folder(tmp_path))
    assert [a.name, b.name, c.name] == ["a", "b", "c"]
    for read in (a, b, c):
        np.testing.assert_allclose(read.panorama.distance, DISTANCE, rtol=1e-6)  # float32
        np.testing.assert_allclose(read.world_from_camera, upright(np.zeros(3)), atol=1e-7)
    np.testing.assert_allclose(b.panorama.rgb, picture(), atol=0.5 / 255 + 1e-6)  # 8 bits


def test_folder_with_poses(tmp_path):
    pose = np.asarray(upright(np.array([1.0, 2.0, 0.5]), 0.7), np.float64)
    poses = {name: pose.tolist() for name in "abc"}
    (write_folder(tmp_path) / "poses.json").write_text(json.dumps(poses))
    np.testing.assert_array_equal(next(read_folder(tmp_path)).world_from_camera, pose)


def test_folder_faults(tmp_path):
    refused("is no folder", read_folder, tmp_path / "none")
    refused("holds no panorama", read_folder, tmp_path)
    write_folder(tmp_path)
    (tmp_path / "b_distance.exr").rename(tmp_path / "d_distance.exr")
    refused(r"b.png has no distance: put b_distance.exr", read_folder, tmp_path)
    np.save(tmp_path / "b_distance.npy", DISTANCE[:8])
    refused(r"b_distance.npy has 8 x 32 values", read_folder, tmp_path)
    (tmp_path / "d_distance.exr").rename(tmp_path / "b_distance.exr")
    refused(r"b.png has 2 distance maps", read_folder, tmp_path)
    (tmp_path / "b_distance.npy").unlink()
    write_rgb(tmp_path / "b.jpg", picture())
    refused(r"is one of 2 pictures of that name", read_folder, tmp_path)
    (tmp_path / "b.jpg").unlink()
    write_rgb(tmp_path / "b.png", picture()[:, :20])
    refused(r"b.png is 20x16; a panorama must be twice as wide", read_folder, tmp_path)


GOOD = np.asarray(upright(np.zeros(3)), np.float64).tolist()


@pytest.mark.parametrize(
    ("poses", "message"),
    [
        ("{", "is no JSON"),
        ("[" * 100_000, "is no JSON"),
        ("[]", "must be an object"),
        (json.dumps({"a": GOOD, "b": GOOD}), "c has no pose"),
        (json.dumps(dict.fromkeys("abcd", GOOD)), "d has a pose but no picture"),
        (json.dumps({"a": GOOD, "b": GOOD, "c": [[1, 2], [3]]}), "c: .*"),
        (json.dumps({"a": GOOD, "b": GOOD, "c": None}), "c: a pose must be a finite 4x4"),
        (json.dumps({"a": GOOD, "b": GOOD, "c": (2 * np.eye(4)).tolist()}), "c: a pose must be a rotation"),
        (json.dumps({"a": GOOD, "b": GOOD, "c": np.diag([1, 1, -1, 1]).tolist()}), "c: a pose must be a rotation"),
        (json.dumps({"a": GOOD, "b": GOOD, "c": np.full((4, 4), np.nan).tolist()}), "c: a pose must be a finite"),
    ],
)
def test_poses_that_do_not_fit(tmp_path, poses, message):
    (write_folder(tmp_path) / "poses.json").write_text(poses)
    refused(f"poses.json:? {message}", read_folder, tmp_path)
