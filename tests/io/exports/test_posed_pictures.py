"""nerfstudio and COLMAP data sets: other readers' cameras put a point on the pixel where ours see it."""

import json

import cv2
import numpy as np
import plyfile
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.geometry.pinhole import pixels_from_points
from rein3d_jax.geometry.poses import invert, pinhole_camera, upright
from rein3d_jax.io.exports.colmap import quaternion, write_colmap
from rein3d_jax.io.exports.nerfstudio import write_nerfstudio
from rein3d_jax.io.exports.point_cloud import Points, thinned_points
from rein3d_jax.io.exports.posed_picture import PosedPicture
from rein3d_jax.scene import Gaussians

SIZE = 32
YAW_PITCH = [(0.0, 0.0), (0.7, 0.3), (2.5, -1.2), (-1.5, np.pi / 2)]  # yaw, pitch
EYES = np.array([[0, 0, 0], [0.3, -0.2, 0.1], [1, 2, -0.5], [0, 0.5, 0]])
AHEAD = np.array([[0.1, -0.3, 1.0], [-0.6, 0.5, 1.4], [0.0, 0.0, 2.0]])  # metres in camera axes
ATOL = 1e-3  # pixels: poses are float32, and images.txt holds pixels to a thousandth


@pytest.fixture(scope="module")
def pictures():
    rng = np.random.default_rng(0)
    cameras = [pinhole_camera(upright(eye, *angles), SIZE, 1.4) for eye, angles in zip(EYES, YAW_PITCH, strict=True)]
    return [
        PosedPicture(f"p{i}", rng.random((SIZE, SIZE, 3)), rng.random((SIZE, SIZE)) > 0.3,
                     np.full((SIZE, SIZE), 2.0), camera)
        for i, camera in enumerate(cameras)
    ]  # fmt: skip


def ours(picture):
    """World points before the camera, and their pixels."""
    camera = picture.camera
    world = AHEAD @ picture.pose[:3, :3].T + picture.pose[:3, 3]
    local = world @ np.asarray(invert(camera.world_from_camera))[:3, :3].T
    local += np.asarray(invert(camera.world_from_camera))[:3, 3]
    return world, np.stack(pixels_from_points(local, camera.focal, camera.centre), axis=-1)


@pytest.fixture(scope="module")
def points(pictures):
    """Two metres from each camera, and one that nobody sees."""
    places = []
    for picture in pictures:
        rays = AHEAD / np.linalg.norm(AHEAD, axis=1, keepdims=True)
        places.append(2 * rays @ picture.pose[:3, :3].T + picture.pose[:3, 3])
    places = np.vstack([*places, [[50.0, 0, 0]]])
    return Points(places, np.arange(3 * len(places), dtype=np.uint8).reshape(-1, 3))


def test_nerfstudio_cameras_put_points_where_ours_do(pictures, points, tmp_path):
    assert write_nerfstudio(tmp_path, iter(pictures), points) == len(pictures)
    scene = json.loads((tmp_path / "transforms.json").read_text())
    assert scene["camera_model"] == "OPENCV"
    for frame, picture in zip(scene["frames"], pictures, strict=True):
        world, pixels = ours(picture)
        x, y, z = np.linalg.inv(frame["transform_matrix"])[:3] @ np.vstack([world.T, np.ones(len(world))])
        assert (z < 0).all()  # OpenGL looks along -z, y up
        u, v = frame["cx"] + frame["fl_x"] * x / -z, frame["cy"] - frame["fl_y"] * y / -z
        np.testing.assert_allclose(np.stack([u, v], axis=-1), pixels, atol=ATOL)
        assert (frame["w"], frame["h"]) == (SIZE, SIZE)


def check_files(folder, image, mask, picture):
    rgb = cv2.imread(str(folder / image))[..., ::-1] / 255
    np.testing.assert_allclose(rgb, picture.rgb, atol=0.5 / 255 + 1e-6)
    white = cv2.imread(str(folder / mask), cv2.IMREAD_GRAYSCALE)
    np.testing.assert_array_equal(white, 255 * picture.known)


def test_nerfstudio_pictures_masks_and_points_are_there(pictures, points, tmp_path):
    write_nerfstudio(tmp_path, pictures, points)
    scene = json.loads((tmp_path / "transforms.json").read_text())
    for frame, picture in zip(scene["frames"], pictures, strict=True):
        check_files(tmp_path, frame["file_path"], frame["mask_path"], picture)
    vertex = plyfile.PlyData.read(tmp_path / scene["ply_file_path"])["vertex"]
    np.testing.assert_allclose(np.stack([vertex[a] for a in "xyz"], axis=-1), points.places, rtol=1e-6)
    np.testing.assert_array_equal(np.stack([vertex[c] for c in ("red", "green", "blue")], axis=-1), points.colours)


def test_colmap_model_read_by_hand(pictures, points, tmp_path):
    assert write_colmap(tmp_path, iter(pictures), points) == len(pictures)
    model = tmp_path / "sparse" / "0"
    (camera,) = [line.split() for line in (model / "cameras.txt").read_text().splitlines()]
    assert camera[:4] == ["1", "PINHOLE", str(SIZE), str(SIZE)]
    fx, fy, cx, cy = map(float, camera[4:])
    lines = (model / "images.txt").read_text().splitlines()
    for head, picture in zip(lines[::2], pictures, strict=True):
        _, *pose, camera, name = head.split()
        assert camera == "1"
        w, x, y, z, *shift = map(float, pose)
        world, pixels = ours(picture)
        axis = np.array([x, y, z])  # Rodrigues: p + 2 w (a x p) + 2 a x (a x p)
        rotated = world + 2 * w * np.cross(axis, world) + 2 * np.cross(axis, np.cross(axis, world))
        local = rotated + shift
        seen = np.stack([cx + fx * local[:, 0] / local[:, 2], cy + fy * local[:, 1] / local[:, 2]], axis=-1)
        np.testing.assert_allclose(seen, pixels, atol=ATOL)
        check_files(tmp_path, f"images/{name}", f"masks/{name}.png", picture)


def test_colmap_model_read_by_pycolmap(pictures, points, tmp_path):
    pycolmap = pytest.importorskip("pycolmap", reason="pip install pycolmap")
    write_colmap(tmp_path, pictures, points)
    model = pycolmap.Reconstruction(tmp_path / "sparse" / "0")
    assert (model.num_images(), model.num_cameras(), model.num_points3D()) == (len(pictures), 1, len(points.places))
    for image in model.images.values():
        picture = next(p for p in pictures if f"{p.name}.png" == image.name)
        for place, pixel in zip(*ours(picture), strict=True):
            np.testing.assert_allclose(image.project_point(place), pixel, atol=ATOL)
        for point in image.get_observation_points2D():
            place = model.points3D[point.point3D_id].xyz
            np.testing.assert_allclose(image.project_point(place), point.xy, atol=ATOL)
    seen = {i: p.track.length() for i, p in model.points3D.items()}
    assert seen[len(points.places)] == 0 and sum(n > 0 for n in seen.values()) >= len(pictures)
    assert all((p.color == points.colours[i - 1]).all() for i, p in model.points3D.items())


def test_quaternions_rotate_as_their_matrices():
    rng = np.random.default_rng(1)
    for wanted in [*rng.standard_normal((20, 4)), [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1], [0, 0.6, 0.8, 0]]:
        w, *v = wanted / np.linalg.norm(wanted)
        cross = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
        found = quaternion(np.eye(3) + 2 * w * cross + 2 * cross @ cross)
        np.testing.assert_allclose(abs(found @ [w, *v]), 1, atol=1e-12)


def test_points_are_thinned_from_what_is_solid():
    n = 100
    sh = np.zeros((n, 4, 3), np.float32)
    sh[:, 0] = 5  # beyond white
    alive, logits = np.arange(n) % 2 == 0, np.where(np.arange(n) < 50, 3.0, -3.0)
    means = np.arange(3 * n, dtype=np.float32).reshape(n, 3)
    scene = Gaussians(means, means, np.zeros((n, 4)), logits, sh, alive)
    assert thinned_points(scene, 1000).places[:, 0].tolist() == [6.0 * i for i in range(25)]
    few = thinned_points(scene, 5)
    assert len(few.places) == 5 and (few.colours == 255).all()
    assert len(thinned_points(scene.replace(alive=np.zeros(n, bool)), 5).places) == 0


@pytest.mark.parametrize("write", [write_nerfstudio, write_colmap])
def test_the_index_is_written_last(pictures, points, tmp_path, write):
    """Cut short, no reader takes the rest for a data set."""

    def cut_short():
        yield pictures[0]
        raise InputError("cut short")

    with pytest.raises(InputError, match="cut short"):
        write(tmp_path, cut_short(), points)
    assert not {"transforms.json", "images.txt"} & {path.name for path in tmp_path.rglob("*")}
