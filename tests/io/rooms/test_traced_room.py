"""A room with ground truth is read as it was written, in our frame; whatever is wrong with it is one clear line."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from experiments.reconstruct.inputs import SAMPLES
from rein3d_jax.errors import InputError
from rein3d_jax.geometry.poses import pinhole_camera, upright
from rein3d_jax.geometry.sphere import rays_of_pose64
from rein3d_jax.io.pictures.distance import write_distance_exr
from rein3d_jax.io.pictures.image import write_rgb
from rein3d_jax.io.rooms.traced_room import read_posed_views, read_traced_room

SHAPE = (16, 32)
BOX = np.array([[-2.0, -3.0, -1.6], [4.0, 1.0, 1.2]])  # walls of a room around the input


def box_distance(eye, rays):
    """Analytic distance from inside the box along unit rays."""
    with np.errstate(divide="ignore"):
        return (np.where(rays > 0, BOX[1] - eye, BOX[0] - eye) / rays).min(-1)


def quarter_left(position):
    """A panorama's c2w that looks along +Y."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]], position
    return pose


def write_room(folder):
    """A box room whose panoramas carry their distance as colour, too."""
    for name, eye, rotation in (("input", (0, 0, 0), np.eye(4)), ("pano", (1, -1, 0), quarter_left((1, -1, 0)))):
        rays = rays_of_pose64(upright(np.zeros(3)), 16) @ rotation[:3, :3].T
        distance = box_distance(np.array(eye), rays)
        write_distance_exr(folder / f"{name}_distance.exr", distance)
        write_rgb(folder / f"{name}.png", np.repeat(distance[..., None] / 8, 3, -1))
    write_rgb(folder / "view.png", np.full((12, 12, 3), 0.5))
    view = {"rgb": "view.png", "c2w": np.asarray(upright(np.ones(3), 0.5)).tolist(), "fx": 6, "fy": 6, "cx": 6, "cy": 6}
    pano = {"rgb": "pano.png", "distance": "pano_distance.exr", "c2w": quarter_left((1, -1, 0)).tolist()}
    video = [{"rgb": "input.png", "c2w": np.eye(4).tolist()}, {"rgb": "pano.png", "c2w": pano["c2w"]}]
    scene = {
        "input": {"rgb": "input.png", "distance": "input_distance.exr"},
        "views": [view | {"width": 12, "height": 12}],
        "panos": [pano],
        "video": video,
    }
    (folder / "scene.json").write_text(json.dumps(scene))
    return scene


def test_everything_is_read_in_our_frame(tmp_path):
    write_room(tmp_path)
    room = read_traced_room(tmp_path)
    np.testing.assert_allclose(room.input.world_from_camera, upright(np.zeros(3)), atol=1e-7)
    for pano in (room.input, *room.panos):
        pose, panorama = pano.world_from_camera, pano.panorama
        expected = box_distance(pose[:3, 3], rays_of_pose64(pose, 16))
        np.testing.assert_allclose(panorama.distance, expected, atol=1e-6)  # float32
        np.testing.assert_allclose(panorama.rgb[..., 0] * 8, expected, atol=8 * 0.51 / 255)  # 8 bits
    np.testing.assert_array_equal(room.video[1].world_from_camera, room.panos[0].world_from_camera)
    np.testing.assert_allclose(room.panos[0].world_from_camera, upright(np.array([1, -1, 0]), np.pi / 2), atol=1e-6)
    (view,) = room.views
    wanted = pinhole_camera(upright(np.ones(3), 0.5), 12, np.pi / 2)
    np.testing.assert_allclose(view.camera.world_from_camera, wanted.world_from_camera, atol=1e-6)
    np.testing.assert_allclose(view.camera.focal, wanted.focal, rtol=1e-6)
    assert (view.camera.width, view.camera.height, view.camera.model) == (12, 12, wanted.model)


def test_the_packaged_room():
    room = read_traced_room(SAMPLES / "room")
    assert room.input.panorama.rgb.shape[:2] == room.input.panorama.distance.shape
    assert len(room.views) == 24 and len(read_posed_views(SAMPLES / "room/scene.json")) == 24


def test_parts_that_a_room_lacks_are_empty(tmp_path):
    scene = write_room(tmp_path)
    (tmp_path / "scene.json").write_text(json.dumps({"input": scene["input"]}))
    room = read_traced_room(tmp_path / "scene.json")
    assert room.views == room.panos == room.video == ()


def edit(key, value):
    """A change of scene.json: the first entry of `key`, or of `key.name`."""

    def change(scene):
        part, _, name = key.partition(".")
        if not name:
            scene[part] = value
        else:
            entry = scene[part] if isinstance(scene[part], dict) else scene[part][0]
            entry[name] = value

    return change


FAULTS = {
    "input missing": (lambda scene: scene.pop("input"), r"scene.json: not a room .*needs input with rgb and distance"),
    "input no object": (edit("input", 3), "scene.json: not a room"),
    "input without distance": (lambda scene: scene["input"].pop("distance"), "scene.json: not a room"),
    "file missing": (edit("input.rgb", "nowhere.png"), "nowhere.png cannot be read"),
    "file outside": (edit("input.rgb", "../input.png"), r"scene.json names the file '../input.png' outside"),
    "absolute": (edit("views.rgb", "/etc/passwd"), "scene.json names the file '/etc/passwd' outside"),
    "address": (edit("panos.rgb", "http://host/a.png"), "scene.json names the file 'http://host/a.png' outside"),
    "zero byte": (edit("video.rgb", "a\0.png"), "scene.json names the file"),
    "name no text": (edit("video.rgb", 5), "scene.json: not a list of video frames .*needs rgb, c2w each"),
    "distance size": (edit("panos.rgb", "small.png"), r"pano_distance.exr has 16 x 32 values"),
    "view size": (edit("views.width", 13), r"view.png is 12x12, but .*scene.json needs 13x12"),
    "frame size": (edit("video.rgb", "small.png"), r"pano.png is 32x16, but .*scene.json needs 64x32"),
    "matrix shape": (edit("views.c2w", [[1, 2], [3, 4]]), "scene.json: not a list of views .*finite 4x4"),
    "matrix scaled": (edit("panos.c2w", (2 * np.eye(4)).tolist()), "scene.json: not a list of panos .*rotation"),
    "matrix nan": (edit("video.c2w", np.full((4, 4), np.nan).tolist()), "scene.json: not a list of video .*finite"),
    "matrix text": (edit("views.c2w", "identity"), "scene.json: not a list of views"),
    "focal zero": (edit("views.fx", 0), "scene.json: not a list of views .*must be positive"),
    "no focal": (lambda scene: scene["views"][0].pop("fx"), "scene.json: not a list of views .*'fx'"),
    "views no list": (edit("views", 3), "scene.json: not a list of views"),
    "panos no list": (edit("panos", {"a": 1}), "scene.json: not a list of panos"),
    "video no list": (edit("video", {"a": 1}), "scene.json: not a list of video frames"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_faults_are_one_clear_line(tmp_path, name):
    change, message = FAULTS[name]
    scene = write_room(tmp_path)
    write_rgb(tmp_path / "small.png", np.full((32, 64, 3), 0.5))
    change(scene)
    (tmp_path / "scene.json").write_text(json.dumps(scene))
    with pytest.raises(InputError, match=message) as caught:
        read_traced_room(tmp_path)
    assert "\n" not in str(caught.value)


def test_a_link_may_not_lead_out(tmp_path):
    scene = write_room(tmp_path)
    inner = tmp_path / "inner"
    inner.mkdir()
    shutil.copy(tmp_path / "input_distance.exr", inner)
    (inner / "input.png").symlink_to(tmp_path / "input.png")
    (inner / "scene.json").write_text(json.dumps({"input": scene["input"]}))
    with pytest.raises(InputError, match=r"'input.png' outside its folder"):
        read_traced_room(inner)


@pytest.mark.parametrize("text", ["", "{", "[1, 2]", "null", "\xff"])
def test_what_is_no_scene(tmp_path, text):
    (tmp_path / "scene.json").write_bytes(text.encode("latin-1"))
    with pytest.raises(InputError, match=r"scene.json(: not a room| is no JSON)"):
        read_traced_room(tmp_path)
    with pytest.raises(InputError, match=r"scene.json(: not a list of views| is no JSON)"):
        read_posed_views(tmp_path / "scene.json")
    with pytest.raises(InputError, match="cannot be read"):
        read_traced_room(Path(tmp_path / "none.json"))
