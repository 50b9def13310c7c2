"""Posed frames, read back: a wall that the frames measured stands where it is, whichever file one takes."""

import json

import cv2
import jax.numpy as jnp
import numpy as np
import OpenImageIO as oiio
import pytest

from rein3d_jax.conventions import PINHOLE
from rein3d_jax.geometry.poses import upright
from rein3d_jax.io.exports.posed_frames import PosedFrame, write_posed_frames
from rein3d_jax.scene import Camera

WALL = 3.0  # metres: the plane x = 3
H, W, F = 12, 16, 8.0
EYE, YAW = np.array([0.5, -0.4, 0.0]), 0.3


def frame():
    camera = Camera(upright(jnp.array(EYE), YAW), jnp.full(2, F), jnp.array([W / 2, H / 2]), PINHOLE, W, H)
    rays = rays_of(W, H, (F, F), (W / 2, H / 2)) @ np.asarray(camera.world_from_camera)[:3, :3].T
    distance = (WALL - EYE[0]) / rays[..., 0]
    distance[0, 0] = 0  # unknown
    distance[0, 1] = 200  # beyond 16 bits of millimetres
    normals = np.broadcast_to([-1.0, 0, 0], (H, W, 3))
    rgb = np.random.default_rng(0).uniform(size=(H, W, 3))
    return PosedFrame(rgb, distance.astype(np.float32), normals, camera)


def rays_of(width, height, focal, centre):
    u, v = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    rays = np.stack([(u - centre[0]) / focal[0], (v - centre[1]) / focal[1], np.ones((height, width))], axis=-1)
    return rays / np.linalg.norm(rays, axis=-1, keepdims=True)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("frames")
    assert write_posed_frames(folder, [frame(), frame()]) == 2
    return folder


def test_distances_of_the_plain_json_reach_the_wall(folder):
    told = json.loads((folder / "frames.json").read_text())["frames"][1]
    distance = oiio.ImageBuf(str(folder / told["distance"])).get_pixels()[..., 0]
    rays = rays_of(told["width"], told["height"], told["focal"], told["centre"])
    pose, (w, x, y, z) = np.array(told["world_from_camera"]), told["quaternion"]
    points = (rays * distance[..., None]) @ pose[:3, :3].T + told["position"]
    known = np.ones((H, W), bool)
    known[0, :2] = False
    np.testing.assert_allclose(points[known][:, 0], WALL, atol=1e-5)  # float32
    matrix = [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
              [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
              [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]  # fmt: skip
    np.testing.assert_allclose(matrix, pose[:3, :3], atol=1e-6)
    normals = oiio.ImageBuf(str(folder / told["normals"])).get_pixels()
    np.testing.assert_array_equal(normals, np.broadcast_to(np.float32([-1, 0, 0]), (H, W, 3)))
    assert distance[0, 0] == 0


def test_depth_in_millimetres_and_nerfstudio_s_axes_reach_it_too(folder):
    scene = json.loads((folder / "transforms.json").read_text())
    told = scene["frames"][0]
    depth = cv2.imread(str(folder / told["depth_file_path"]), cv2.IMREAD_UNCHANGED)
    assert depth.dtype == np.uint16 and (depth[0, :2] == 0).all()
    u, v = np.meshgrid(np.arange(W) + 0.5, np.arange(H) + 0.5)
    local = np.stack([(u - told["cx"]) / told["fl_x"], -(v - told["cy"]) / told["fl_y"], -np.ones((H, W))], axis=-1)
    pose = np.array(told["transform_matrix"])
    points = (local * depth[..., None] / 1000) @ pose[:3, :3].T + pose[:3, 3]
    assert np.abs(points[1:, :, 0] - WALL).max() < 0.5e-3 * 1.5  # half a millimetre along a slant
    seen = cv2.imread(str(folder / told["file_path"]))[..., ::-1] / 255
    assert np.abs(seen - frame().rgb).max() < 0.51 / 255
