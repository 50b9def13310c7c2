"""Mesh scenes: the analytic distance of a box, marks where they belong, textures the right way up and without
aliasing, a place to stand."""

import builtins
import dataclasses

import numpy as np
import PIL.Image
import pytest
import trimesh

from rein3d_jax.errors import InputError
from rein3d_jax.geometry.poses import upright
from rein3d_jax.geometry.sphere import rays_of_pose64
from rein3d_jax.io.meshes.mesh_file import read_mesh_scene
from rein3d_jax.meshes.camera_place import find_camera_place, floor_height
from rein3d_jax.meshes.mesh_scene import AMBIENT, DIRECTED, SKY, mesh_scene
from rein3d_jax.meshes.texture import texture
from rein3d_jax.meshes.triangles import triangles

LOW, HIGH = np.array([-2.0, -3.0, 0.0]), np.array([2.5, 3.0, 2.6])  # a room, Z up
EYE = np.array([0.3, -0.4, 1.6])
RED, GREEN, BLUE = (220, 0, 0), (0, 200, 0), (0, 0, 210)


def box(low, high, colour=(200, 200, 200)):
    """A box, Z up, of one colour."""
    mesh = trimesh.creation.box(bounds=[low, high])
    mesh.visual.face_colors = [*colour, 255]
    return mesh


def plate(low, high, colour):
    """A box seen from EYE."""
    return box(np.add(EYE, low), np.add(EYE, high), colour)


def write(path, *meshes):
    """Z up meshes as a file with Y up: (x, y, z) -> (x, z, -y)."""
    scene = trimesh.Scene(list(meshes))
    scene.apply_transform([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
    scene.export(path)
    return path


def box_distance(eye, rays):
    with np.errstate(divide="ignore"):
        return (np.where(rays > 0, HIGH - eye, LOW - eye) / rays).min(-1)


@pytest.mark.parametrize("name", ["room.glb", "room.gltf", "room.obj"])
def test_distance_of_a_box_is_exact(tmp_path, name):
    scene = read_mesh_scene(write(tmp_path / name, box(LOW, HIGH)))
    np.testing.assert_allclose(scene.bounds, [LOW, HIGH], atol=1e-6)  # float32 in the file
    for pose in (upright(EYE), upright(EYE, 2.0, 0.4)):
        pose = np.asarray(pose, np.float64)
        rgb, distance = scene.trace(pose, 32)
        assert rgb.shape == (32, 64, 3) and rgb.dtype == distance.dtype == np.float32
        # float32 vertices of 3 m leave 2e-7, the pose's float32 rotation as much a metre.
        np.testing.assert_allclose(distance, box_distance(pose[:3, 3], rays_of_pose64(pose, 32)), atol=2e-6)


def test_far_from_the_file_s_origin_and_in_other_units(tmp_path):
    shift = np.array([4000.0, -2500.0, 300.0])
    soup = read_mesh_scene(write(tmp_path / "a.glb", box(LOW, HIGH))).soup
    far = mesh_scene("far", dataclasses.replace(soup, corners=soup.corners + shift)).at(shift + EYE)
    rays = rays_of_pose64(upright(np.zeros(3)), 16)
    distance = far.trace(np.asarray(upright(np.zeros(3)), np.float64), 16)[1]
    np.testing.assert_allclose(distance, box_distance(EYE, rays), atol=1e-6)  # vertices of 2.5 m in float32
    centimetres = read_mesh_scene(write(tmp_path / "b.glb", box(100 * LOW, 100 * HIGH)), scale=0.01)
    np.testing.assert_allclose(centimetres.bounds, [LOW, HIGH], atol=1e-6)
    lying = read_mesh_scene(write(tmp_path / "c.glb", box(LOW, HIGH)), up="z")
    np.testing.assert_allclose(np.ptp(lying.bounds, axis=0), (HIGH - LOW)[[0, 2, 1]], atol=1e-6)


def test_marks_appear_where_the_frame_says(tmp_path):
    """A red mark ahead (+X), a green one to the left (+Y), a blue one overhead, in a grey room."""
    marks = [
        plate([1.9, -0.3, -0.3], [2.0, 0.3, 0.3], RED),
        plate([-0.3, 1.9, -0.3], [0.3, 2.0, 0.3], GREEN),
        plate([-0.3, -0.3, 0.8], [0.3, 0.3, 0.9], BLUE),
    ]
    scene = read_mesh_scene(write(tmp_path / "room.glb", box(LOW, HIGH), *marks))
    rgb, distance = scene.at(EYE).trace(np.asarray(upright(np.zeros(3)), np.float64), 32)
    for (row, column), channel, away in (((16, 32), 0, 1.9), ((16, 16), 1, 1.9), ((0, 5), 2, 0.8)):
        assert rgb[row, column].argmax() == channel and rgb[row, column].min() < 0.05, (row, column)
        assert away <= distance[row, column] < away + 0.02  # half a pixel off the axis
    assert np.ptp(rgb[16, 48]) < 1e-3  # nothing on the right
    yawed = scene.at(EYE).trace(np.asarray(upright(np.zeros(3), np.pi / 2), np.float64), 32)[0]
    np.testing.assert_allclose(yawed, np.roll(rgb, 16, axis=1), atol=0.02)  # edges meet other samples


def test_light_is_what_the_module_says(tmp_path):
    """base (AMBIENT + DIRECTED (1 + n . l) / 2) with l = (.36, .48, .8): the six inner walls of a white box."""
    scene = read_mesh_scene(write(tmp_path / "room.glb", box(LOW, HIGH, (255, 255, 255))))
    rgb = scene.trace(np.asarray(upright(EYE), np.float64), 32)[0]
    for (row, column), along in (((16, 32), -0.36), ((16, 0), 0.36), ((16, 16), -0.48), ((0, 0), -0.8), ((31, 0), 0.8)):
        np.testing.assert_allclose(rgb[row, column], AMBIENT + DIRECTED * (1 + along) / 2, atol=1e-6)


def quad(path, picture, repeat=1):
    """A 2 x 2 m picture that faces -X, 2 m ahead of the origin: OBJ, Z up, its u to the right."""
    PIL.Image.fromarray(picture).save(path.with_suffix(".png"))
    path.with_suffix(".mtl").write_text(f"newmtl a\nKd 0 0 0\nmap_Kd ./{path.stem}.png\n")
    corners = ["v 2 1 -1", "v 2 -1 -1", "v 2 -1 1", "v 2 1 1"]
    places = [f"vt {u * repeat} {v * repeat}" for u, v in ((0, 0), (1, 0), (1, 1), (0, 1))]
    faces = ["usemtl a", "f 1/1 2/2 3/3", "f 1/1 3/3 4/4"]
    path.write_text("\n".join([f"mtllib {path.stem}.mtl", *corners, *places, *faces, ""]))
    return path


@pytest.mark.parametrize("kind", ["obj", "glb"])
def test_textures_are_the_right_way_up(tmp_path, kind):
    picture = np.zeros((64, 64, 3), np.uint8)
    picture[:32, :32], picture[:32, 32:], picture[32:, :32] = RED, GREEN, BLUE  # upper left, upper right, lower left
    path = quad(tmp_path / "quad.obj", picture)
    if kind == "glb":
        (mesh,) = trimesh.load_scene(path).geometry.values()
        mesh.visual.material = trimesh.visual.material.PBRMaterial(baseColorTexture=PIL.Image.fromarray(picture))
        mesh.export(path := tmp_path / "quad.glb")
    rgb, distance = read_mesh_scene(path, up="z").trace(np.asarray(upright(np.zeros(3)), np.float64), 64)
    light = AMBIENT + DIRECTED * (1 - 0.36) / 2
    for (row, column), colour in (((28, 60), RED), ((28, 67), GREEN), ((35, 60), BLUE), ((35, 67), (0, 0, 0))):
        np.testing.assert_allclose(rgb[row, column], np.array(colour) / 255 * light, atol=1e-3, err_msg=(row, column))
    assert distance[32, 64] == pytest.approx(2, rel=1e-3) and distance[32, 0] == 0
    np.testing.assert_allclose(rgb[32, 0], SKY)


def test_fine_textures_do_not_alias(tmp_path):
    """A checkerboard whose squares are a twentieth of a pixel shows its mean."""
    board = np.indices((64, 64)).sum(0) % 2 * 255
    path = quad(tmp_path / "board.obj", np.repeat(board[..., None], 3, -1).astype(np.uint8), repeat=16)
    rgb, _ = read_mesh_scene(path, up="z").trace(np.asarray(upright(np.zeros(3)), np.float64), 64)
    inner = rgb[26:38, 58:70] / (AMBIENT + DIRECTED * (1 - 0.36) / 2)
    np.testing.assert_allclose(inner, 0.5, atol=0.01)  # halvings round to bytes


def test_samples_agree_on_distance_and_smooth_edges(tmp_path):
    scene = read_mesh_scene(write(tmp_path / "room.glb", box(LOW, HIGH), box(EYE + 0.5, EYE + 0.9, RED)))
    pose = np.asarray(upright(EYE), np.float64)
    one, three = (scene.trace(pose, 16, samples=samples) for samples in (1, 3))
    np.testing.assert_allclose(one[1], three[1], atol=1e-6)  # the same centre rays, rounded apart
    assert len(np.unique(three[0][..., 0])) > len(np.unique(one[0][..., 0]))


def test_a_place_to_stand(tmp_path):
    """Beside a table that fills half of the room, the farthest place is in the middle of the other half."""
    table = box([-2.0, 0.0, 0.0], [2.5, 3.0, 0.8], BLUE)
    scene = read_mesh_scene(write(tmp_path / "room.glb", box(LOW, HIGH), table))
    place = find_camera_place(scene)
    assert floor_height(scene) == pytest.approx(0.0, abs=1e-6) and place.eye[2] == pytest.approx(1.6, abs=1e-6)
    assert place.eye[1] == pytest.approx(-1.5, abs=0.1) and place.clearance == pytest.approx(1.5, abs=0.1)  # the grid
    np.testing.assert_array_equal(find_camera_place(scene).eye, place.eye)
    moved = find_camera_place(scene.at([1.0, 2.0, 3.0]))
    np.testing.assert_allclose(moved.eye, place.eye - [1.0, 2.0, 3.0], atol=1e-6)


def test_nowhere_to_stand(tmp_path):
    low = read_mesh_scene(write(tmp_path / "low.glb", box(LOW, [2.5, 3.0, 1.5])))
    with pytest.raises(InputError, match=r"low.glb has no place to stand, 1.6 m above 0.00"):
        find_camera_place(low)
    wall = read_mesh_scene(quad(tmp_path / "wall.obj", np.zeros((4, 4, 3), np.uint8)), up="z")
    with pytest.raises(InputError, match=r"wall.obj has no level surface"):
        find_camera_place(wall)


@pytest.mark.parametrize("lacking", ["trimesh", "PIL.Image", "embreex.mesh_construction"])
def test_missing_packages_are_one_line(tmp_path, monkeypatch, lacking):
    path, real = write(tmp_path / "room.glb", box(LOW, HIGH)), builtins.__import__

    def without(name, *arguments, **options):
        if name == lacking:
            raise ImportError(name)
        return real(name, *arguments, **options)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(InputError, match=r"pip install 'rein3d-jax\[data\]'"):
        read_mesh_scene(path)


def test_a_soup_keeps_its_own():
    with pytest.raises(ValueError, match="faces name vertex 3 of 3"):
        triangles(np.eye(3), [[0, 1, 3]], None, np.ones(3), None)
    with pytest.raises(ValueError, match="not finite"):
        triangles(np.full((3, 3), np.nan), [[0, 1, 2]], None, np.ones(3), None)
    with pytest.raises(ValueError, match=r"shape \(2, 2\) for 3 vertices"):
        triangles(np.eye(3), [[0, 1, 2]], np.zeros((2, 2)), np.ones(3), texture(np.zeros((1, 1, 3), np.uint8)))
