"""A small room with ground truth in the layout of ../shared/rooms: a box to walk in and one that hides a part of it."""

import json

import numpy as np
import pytest

from rein3d_jax.geometry.poses import pinhole_camera, upright
from rein3d_jax.io.distance import write_distance_exr
from rein3d_jax.io.image import write_rgb
from rein3d_jax.io.posed_panorama import UNTURNED, rays_of_pose

WALLS = np.array([3.0, 2.5, 1.4])  # half sizes, metres; the input stands in the middle
CHEST = np.array([[1.0, -0.6, -1.4], [1.6, 0.5, 0.2]])  # two opposite corners
ELSEWHERE = (0.4, 1.2, 0.0)  # sees what the chest hides from the input


def seen(eye, rays):
    """Colour (..., 3) and distance (...) along unit rays from `eye`."""
    eye = np.asarray(eye, float)
    crossings = (CHEST[:, None, None] - eye) / rays
    entry, leave = crossings.min(axis=0).max(axis=-1), crossings.max(axis=0).min(axis=-1)
    distance = np.where((entry > 0) & (entry < leave), entry, ((np.sign(rays) * WALLS - eye) / rays).min(axis=-1))
    points = eye + rays * distance[..., None]
    waves = points @ np.array([[2.0, 0.5, 1.2], [-1.0, 2.5, 0.5], [1.5, -0.5, 3.0]]).T
    return 0.5 + 0.4 * np.sin(waves), distance


def write_room(folder):
    """Input of 64 rows, a video and a panorama of 32, views of 48 x 48 from the input's place and from elsewhere."""
    folder.mkdir(parents=True)

    def panorama(name, eye, height, depth=True):
        pose = np.asarray(upright(np.asarray(eye)), np.float64)
        rgb, distance = seen(eye, rays_of_pose(pose, height))
        write_rgb(folder / f"{name}.png", rgb)
        if depth:
            write_distance_exr(folder / f"{name}_distance.exr", distance)
        c2w = np.eye(4)
        c2w[:3, 3] = eye
        return {"rgb": f"{name}.png", "distance": f"{name}_distance.exr", "c2w": c2w.tolist()}

    def view(name, eye, yaw):
        camera = pinhole_camera(upright(np.asarray(eye), yaw), 48, np.pi / 2)
        pose = np.asarray(camera.world_from_camera, np.float64)
        side = (np.arange(48) + 0.5 - 24) / 24
        rays = np.stack([*np.meshgrid(side, side), np.ones((48, 48))], axis=-1)
        rays = rays / np.linalg.norm(rays, axis=-1, keepdims=True) @ pose[:3, :3].T
        write_rgb(folder / f"{name}.png", seen(eye, rays)[0])
        return {"rgb": f"{name}.png", "c2w": pose.tolist(), "fx": 24, "fy": 24, "cx": 24, "cy": 24}

    scene = {
        "input": panorama("input", (0.0, 0.0, 0.0), 64),
        "views": [view("origin", (0.0, 0.0, 0.0), 0.0), view("right", ELSEWHERE, 0.0), view("left", ELSEWHERE, 3.0)],
        "panos": [panorama("pano", ELSEWHERE, 32)],
        "video": [panorama(f"video{i}", (0.0, 0.3 * i, 0.0), 32, depth=False) for i in range(4)],
    }
    (folder / "scene.json").write_text(json.dumps(scene))


@pytest.fixture(scope="session")
def rooms(tmp_path_factory):
    """A folder with room2 and room10, which are alike."""
    folder = tmp_path_factory.mktemp("rooms")
    for name in ("room2", "room10"):
        write_room(folder / name)
    return folder


@pytest.fixture(scope="session")
def turned_pose():
    """world_from_camera (4, 4) of an unturned panorama at the origin."""
    pose = np.eye(4)
    pose[:3, :3] = UNTURNED
    return pose
