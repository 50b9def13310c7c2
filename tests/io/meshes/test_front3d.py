"""A house of 3D-FRONT's layout: where meshes and models stand, what rooms hold, textures; and every fault."""

import copy
import json

import numpy as np
import PIL.Image
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.geometry.poses import upright
from rein3d_jax.io.meshes.front3d import read_front, room_names

# A room 4 x 3 m and 2.5 m high, Y up, its floor at y = 0: corners, and the faces of its six sides.
SIZE = np.array([4.0, 2.5, 3.0])
CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (0, 1) for z in (-0.5, 0.5)]) * SIZE
SIDES = {
    "Floor": [0, 1, 5, 0, 5, 4],
    "Ceiling": [2, 6, 7, 2, 7, 3],
    "WallInner": [0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5, 0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6],
}
HALF = float(np.sqrt(0.5))
# A model 1 m long along its +Z, 0.2 wide, 0.4 high, standing on y = 0.
MODEL = "mtllib model.mtl\nusemtl m\n" + "".join(
    f"v {x} {y} {z}\n" for x in (-0.1, 0.1) for y in (0, 0.4) for z in (0, 1)
)
MODEL += "vt 0 0\nvt 1 0\nvt 0 1\n" + "".join(f"f {a}/1 {b}/2 {c}/3\n" for a, b, c in ((1, 2, 4), (1, 4, 3), (5, 6, 8)))


def write_house(folder):
    (folder / "models" / "chair").mkdir(parents=True)
    (folder / "models" / "chair" / "raw_model.obj").write_text(MODEL)
    (folder / "models" / "chair" / "model.mtl").write_text("newmtl m\nKd 1 1 1\nmap_Kd ./texture.png\n")
    PIL.Image.new("RGB", (4, 4), (250, 0, 0)).save(folder / "models" / "chair" / "texture.png")
    (folder / "textures" / "wood").mkdir(parents=True)
    PIL.Image.new("RGB", (4, 4), (0, 120, 0)).save(folder / "textures" / "wood" / "texture.png")
    meshes = [
        {"uid": f"{name}/1", "type": name, "xyz": CORNERS.ravel().tolist(), "faces": faces, "material": f"{name}/m"}
        | {"uv": CORNERS[:, [0, 2]].ravel().tolist(), "normal": [0] * 24}
        for name, faces in SIDES.items()
    ]
    materials = [
        {"uid": "Floor/m", "jid": "wood", "texture": "https://host/i/wood/wallfloor.png", "color": [9, 9, 9, 255]}
        | {"UVTransform": [2, 0, 0, 0, 3, 0, 0, 0, 1]},
        {"uid": "WallInner/m", "jid": "", "texture": "", "color": [51, 102, 153, 255]},
    ]
    at = {"pos": [0.0, 0.0, 0.0], "rot": [0, 0, 0, 1], "scale": [1, 1, 1]}
    chair = {"ref": "f1", "instanceid": "furniture/1", "pos": [0.5, 0.1, -0.2], "rot": [0, HALF, 0, HALF]}
    rooms = [
        {"type": "Bedroom", "instanceid": "Bedroom-1", "children": [{"ref": mesh["uid"]} | at for mesh in meshes]},
        {"type": "Hall", "instanceid": "Hall-2", "children": [{"ref": "WallInner/1"} | at]},
    ]
    rooms[0]["children"] += [chair | {"scale": [1, 2, 1.5]}, {"ref": "f2"} | at, {"ref": "f3"} | at]
    furniture = [
        {"uid": "f1", "jid": "chair", "valid": True},
        {"uid": "f2", "jid": "unpublished", "valid": True},
        {"uid": "f3", "jid": "chair", "valid": False},
    ]
    house = {"uid": "h", "furniture": furniture, "mesh": meshes, "material": materials, "scene": {"room": rooms}}
    (folder / "house.json").write_text(json.dumps(house))
    return house


def read(folder, **options):
    return read_front(folder / "house.json", folder / "models", textures=folder / "textures", **options)


def test_models_stand_where_the_house_says(tmp_path):
    """R (scale v) + pos with Y up, by hand: a quarter turn about +Y brings the model's +Z to +X."""
    write_house(tmp_path)
    scene = read(tmp_path)
    chair = scene.soup.corners[scene.soup.textured == len(scene.soup.textures) - 1].reshape(-1, 3)
    # x: pos .5 + 0..1.5 (its z, scaled); y (ours): .2 +- .1 (its x turns to -z); z (ours): .1 + 0...8 (its y, scaled)
    np.testing.assert_allclose(chair.min(0), [0.5, 0.1, 0.1], atol=1e-6)  # text of 7 digits
    np.testing.assert_allclose(chair.max(0), [2.0, 0.3, 0.9], atol=1e-6)
    np.testing.assert_allclose(scene.bounds, [[-2, -1.5, 0], [2, 1.5, 2.5]], atol=1e-9)
    assert scene.missing == ("model unpublished",)


def test_colours_textures_and_distance(tmp_path):
    write_house(tmp_path)
    scene = read(tmp_path)
    pose = np.asarray(upright(np.array([-0.5, -1.0, 1.6])), np.float64)
    rgb, distance = scene.trace(pose, 32)
    assert distance[16, 0] == pytest.approx(1.5, abs=5e-3) and distance[31, 0] == pytest.approx(1.6, abs=5e-3)
    assert (distance > 0).all()
    np.testing.assert_allclose(rgb[16, 0] / rgb[16, 0, 2] * 153, [51, 102, 153], rtol=1e-5)  # the wall's paint
    np.testing.assert_allclose(rgb[31, 0] / rgb[31, 0, 1], [0, 1, 0], atol=1e-5)  # the floor's wood
    np.testing.assert_allclose(np.ptp(rgb[0, 0]), 0, atol=1e-6)  # the ceiling has no material: grey
    red = np.argwhere(rgb[..., 0] > 3 * rgb[..., 1].clip(1e-3))
    # The chair: seen at x 1 to 2.5 ahead and 1.1 to the left, 48 to 24 degrees left of column 32.
    assert len(red) and red[:, 1].min() >= 23 and red[:, 1].max() <= 28


def test_uv_transform_repeats_the_floor(tmp_path):
    write_house(tmp_path)
    floor = read(tmp_path).soup.uv[0]
    np.testing.assert_allclose(floor, CORNERS[[0, 1, 5]][:, [0, 2]] * [2, 3], rtol=1e-6)


def test_one_room_and_shared_walls(tmp_path):
    write_house(tmp_path)
    assert room_names(tmp_path / "house.json") == ["Bedroom-1", "Hall-2"]
    whole, bedroom, hall = (read(tmp_path, room=room).soup.corners for room in (None, "Bedroom-1", "Hall-2"))
    assert len(whole) == len(bedroom) == 12 + 3 and len(hall) == 8  # the wall of both rooms comes once


def test_without_textures_paint_stands_in_and_is_confessed(tmp_path):
    write_house(tmp_path)
    scene = read_front(tmp_path / "house.json", tmp_path / "models")
    assert scene.missing == ("model unpublished", "texture wood")
    np.testing.assert_allclose(scene.soup.colour[0], np.full(3, 9 / 255), rtol=1e-6)


def mesh(key, value):
    return lambda house: house["mesh"][0].update({key: value})


def child(key, value):
    return lambda house: house["scene"]["room"][0]["children"][3].update({key: value})


FAULTS = {
    "no scene": (lambda house: house.pop("scene"), "house.json is no house of 3D-FRONT"),
    "no mesh": (lambda house: house.pop("mesh"), "house.json is no house of 3D-FRONT"),
    "empty": (lambda house: house["scene"].update(room=[]), "house.json holds no triangle"),
    "rooms no list": (lambda house: house["scene"].update(room=3), "house.json is no house of 3D-FRONT"),
    "xyz odd": (mesh("xyz", [1, 2]), "house.json is no house of 3D-FRONT"),
    "xyz text": (mesh("xyz", ["a"] * 24), "house.json is no house of 3D-FRONT"),
    "xyz nan": (mesh("xyz", [float("nan")] * 24), "house.json is no house of 3D-FRONT .*not finite"),
    "faces out of range": (mesh("faces", [0, 1, 8]), "house.json is no house of 3D-FRONT .*vertex 8 of 8"),
    "faces negative": (mesh("faces", [0, 1, -1]), "house.json is no house of 3D-FRONT .*vertex -1 of 8"),
    "uv short": (mesh("uv", [0, 1]), "house.json is no house of 3D-FRONT .*texture coordinates"),
    "rot of three": (child("rot", [0, 0, 1]), "house.json is no house of 3D-FRONT .*quaternion"),
    "rot zero": (child("rot", [0, 0, 0, 0]), "house.json is no house of 3D-FRONT .*quaternion"),
    "pos text": (child("pos", "here"), "house.json is no house of 3D-FRONT"),
    "path": (lambda house: house["furniture"][0].update(jid="../.."), r"names the file '../../raw_model.obj' outside"),
    "texture path": (
        lambda house: house["material"][0].update(jid="/etc"),
        r"names the file '/etc/texture.png' outside",
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_faults_are_one_clear_line(tmp_path, name):
    change, message = FAULTS[name]
    house = copy.deepcopy(write_house(tmp_path))
    change(house)
    (tmp_path / "house.json").write_text(json.dumps(house))
    with pytest.raises(InputError, match=message) as caught:
        read(tmp_path)
    assert "\n" not in str(caught.value)


def test_faults_of_files(tmp_path):
    write_house(tmp_path)
    with pytest.raises(InputError, match=r"house.json has no room 'Attic': it has Bedroom-1, Hall-2"):
        read(tmp_path, room="Attic")
    with pytest.raises(InputError, match="nowhere is no folder"):
        read_front(tmp_path / "house.json", tmp_path / "nowhere")
    (tmp_path / "textures/wood/texture.png").write_text("hello")
    with pytest.raises(InputError, match=r"wood/texture.png cannot be opened"):
        read(tmp_path)
    write_model = (tmp_path / "models/chair/raw_model.obj").write_text
    write_model("hello")
    with pytest.raises(InputError, match=r"raw_model.obj (is damaged|holds no triangle)"):
        read_front(tmp_path / "house.json", tmp_path / "models")
    for text in ("", "{", "[]", "null"):
        (tmp_path / "house.json").write_text(text)
        with pytest.raises(InputError, match=r"house.json is no (JSON|house)"):
            read(tmp_path)
