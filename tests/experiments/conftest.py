"""A small room with ground truth as evaluate reads them: a box to walk in and one that hides a part of it."""

import dataclasses
import functools
import json
from types import SimpleNamespace

import numpy as np
import pytest

from experiments.reconstruct.inputs import SAMPLES
from rein3d_jax.geometry.poses import pinhole_camera, upright
from rein3d_jax.geometry.sphere import WORLD_FROM_CAMERA_AXES, rays_of_pose64
from rein3d_jax.io.pictures.distance import write_distance_exr
from rein3d_jax.io.pictures.image import write_rgb

WALLS = np.array([3.0, 2.5, 1.4])  # half sizes, metres; the input stands in the middle
CHEST = np.array([[1.0, -0.6, -1.4], [1.6, 0.5, 0.2]])  # two opposite corners
ELSEWHERE = (0.4, 1.2, 0.0)  # sees what the chest hides from the input
RECIPE = """
[input]
height = 64
[explore]
trajectories = 2
step = 0.8
[restore]
height = 64
[refine]
steps = 4
batch = 1
sh_degree = 0
evaluate_every = 2
[refine.views]
size = 32
[refine.densify]
start = 2
every = 2
stop = 4
[film]
width = 64
height = 48
step = 0.8
yaw_step = 0.8
"""


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
        rgb, distance = seen(eye, rays_of_pose64(pose, height))
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
def recipe(tmp_path_factory):
    """A recipe of seconds on the packaged room, with 6 of its 24 ground-truth views."""
    folder = tmp_path_factory.mktemp("recipe")
    scene = json.loads((SAMPLES / "room" / "scene.json").read_text())
    views = [view | {"rgb": str(SAMPLES / "room" / view["rgb"])} for view in scene["views"][::4]]
    (folder / "scene.json").write_text(json.dumps({"views": views}))
    path = folder / "tiny.toml"
    path.write_text(RECIPE.replace("[input]", f"[input]\nviews = {json.dumps(str(folder / 'scene.json'))}"))
    return path


@pytest.fixture(scope="session")
def rooms(tmp_path_factory):
    """A folder with room2 and room10, which are alike."""
    folder = tmp_path_factory.mktemp("rooms")
    for name in ("room2", "room10"):
        write_room(folder / name)
    return folder


@pytest.fixture(scope="session")
def room():
    """What `rooms` are: half sizes of the walls (3,), opposite corners of the chest (2, 3)."""
    return SimpleNamespace(walls=WALLS, chest=CHEST)


@pytest.fixture(scope="session")
def room_seen():
    """(eye (3,), unit rays (..., 3)) -> colour (..., 3) and distance (...) of the room."""
    return seen


@pytest.fixture(scope="session")
def turned_pose():
    """world_from_camera (4, 4) of an unturned panorama at the origin."""
    pose = np.eye(4)
    pose[:3, :3] = WORLD_FROM_CAMERA_AXES
    return pose


@pytest.fixture(scope="module")
def one_step_a_config():
    """Trainings of the learned restorer that differ in folder and seed alone take one step: neither is in it."""
    from experiments.train_restore.learned import train

    made = functools.cache(train.make_learned_step)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(train, "make_learned_step", lambda config: made(dataclasses.replace(config, output="", seed=0)))
        patch.setattr(train, "data_parallel", functools.cache(train.data_parallel))
        yield


@pytest.fixture(scope="session")
def run_folder(rooms, tmp_path_factory):
    """A run's folder, written from the room's truth: its restored videos are exact, its scene is the lifted input."""
    from experiments.config import config_from, dump_config
    from experiments.reconstruct.config import ReconstructConfig
    from experiments.reconstruct.inputs import input_panorama
    from rein3d_jax.depth.level import unasked_lean
    from rein3d_jax.explore.trajectories import radial_trajectories
    from rein3d_jax.geometry.sphere import rays_of_pose as rays_at
    from rein3d_jax.io.files.checkpoint import save
    from rein3d_jax.io.splats.ply import write_ply
    from rein3d_jax.pipeline.explore_and_restore import Explored
    from rein3d_jax.pipeline.survey import lift_scene, with_distance
    from rein3d_jax.scene import Video

    folder, room = tmp_path_factory.mktemp("run") / "room", rooms / "room2"
    files = {"panorama": str(room / "input.png"), "distance": str(room / "input_distance.exr"), "views": "none"}
    given = {**files, "height": 64, "level": False}
    table = {"output": str(folder), "input": given, "explore": {"trajectories": 2, "step": 0.4}}
    config = config_from(ReconstructConfig, table)

    def stage(name, result):
        key = np.zeros(32, np.uint8)
        save(folder / "stages" / f"{name}.npz", {"key": key, "result": result, "seconds": np.float64(1)})

    panorama, _ = with_distance(input_panorama(config.input), config)
    coarse, paths = lift_scene(panorama, config.lift), radial_trajectories(panorama, config=config.explore)
    stage("read", (panorama, np.array([False]), "", unasked_lean()))
    stage("lift", coarse)
    stage("explore", paths)
    stage("peel", coarse)
    for index, count in enumerate(np.asarray(paths.counts)):
        poses = np.asarray(paths.world_from_camera[index, :count])
        truth = [seen(pose[:3, 3], np.asarray(rays_at(pose, 64, 128))) for pose in poses]
        rgb, distance = (np.float32(part) for part in zip(*truth, strict=True))
        video = Video(rgb, np.ones_like(distance), distance, poses)
        shared, nothing, buffers = np.zeros((), np.float32), np.zeros((), np.int32), np.zeros(4, np.int32)
        stage(f"restore-{index:02d}", Explored(coarse, video, np.int32(index + 1), shared, nothing, buffers))
    write_ply(folder / "scene.ply", coarse)
    (folder / "config.toml").write_text(dump_config(config))
    return folder
