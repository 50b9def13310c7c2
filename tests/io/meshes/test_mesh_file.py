"""What a mesh file may not do: leave its folder, open an address, be damaged without a clear line."""

import json
import random
import socket

import numpy as np
import PIL.Image
import pytest
import trimesh

from rein3d_jax.errors import InputError
from rein3d_jax.io.meshes.mesh_file import read_mesh

OBJ = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n"
MTL = "newmtl m\nmap_Kd a.png\n"


def write_obj(folder, obj=OBJ, mtl=MTL):
    PIL.Image.new("RGB", (8, 8), (255, 0, 0)).save(folder / "a.png")
    (folder / "a.mtl").write_text(mtl)
    (folder / "a.obj").write_text(obj)
    return folder / "a.obj"


def refused(path, message, **options):
    with pytest.raises(InputError, match=message) as caught:
        read_mesh(path, **options)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value), caught.value


def test_obj_values(tmp_path):
    soup = read_mesh(write_obj(tmp_path))
    np.testing.assert_array_equal(soup.corners[0], [[0, 0, 0], [1, 0, 0], [0, 0, 1]])  # Y up becomes Z up
    np.testing.assert_array_equal(soup.uv[0], [[0, 0], [1, 0], [0, 1]])
    np.testing.assert_array_equal(soup.textures[0].levels[0][0, 0], [255, 0, 0])
    plain = read_mesh(write_obj(tmp_path, mtl="newmtl m\nKd 0.2 0.4 0.6\n"))
    assert not plain.textures and (plain.textured == -1).all()
    np.testing.assert_allclose(plain.colour[0], [0.2, 0.4, 0.6], atol=1e-6)  # bytes hold these


def test_glb_instances_and_linear_factors(tmp_path):
    """Two nodes of one mesh stand where their matrices say; a factor of linear light .5 is .735 in sRGB."""
    material = trimesh.visual.material.PBRMaterial(baseColorFactor=[0.5, 0.5, 0.5, 1.0])
    mesh = trimesh.creation.box((1, 1, 1))
    mesh.visual = trimesh.visual.TextureVisuals(uv=np.zeros((8, 2)), material=material)
    scene = trimesh.Scene()
    scene.add_geometry(mesh, geom_name="box", transform=trimesh.transformations.translation_matrix([5, 0, 0]))
    scene.graph.update("again", geometry="box", matrix=trimesh.transformations.translation_matrix([0, 7, 0]))
    scene.export(tmp_path / "two.glb")
    soup = read_mesh(tmp_path / "two.glb")
    centres = {tuple(part.reshape(-1, 3).mean(0).round(5)) for part in np.split(soup.corners, 2)}
    assert centres == {(5.0, 0.0, 0.0), (0.0, 0.0, 7.0)}
    np.testing.assert_allclose(soup.colour, 0.735, atol=0.003)  # the factor is kept as a byte


@pytest.mark.parametrize("name", ["../secret.png", "/etc/hostname", "http://127.0.0.1:9/a.png", "gone.png"])
def test_an_obj_names_no_file_elsewhere(tmp_path, name):
    folder = tmp_path / "folder"
    folder.mkdir()
    PIL.Image.new("RGB", (8, 8)).save(tmp_path / "secret.png")
    message = "which is not there" if name == "gone.png" else "outside its folder"
    refused(write_obj(folder, mtl=f"newmtl m\nmap_Kd {name}\n"), f"names the file '{name}'.*{message}")
    refused(write_obj(folder, obj=OBJ.replace("a.mtl", name)), f"names the file '{name}'.*{message}")


@pytest.mark.parametrize("uri", ["../secret.bin", "/etc/hostname", "http://127.0.0.1:9/a.bin", "file:///etc/hostname"])
def test_a_gltf_names_no_file_elsewhere(tmp_path, uri):
    folder = tmp_path / "folder"
    folder.mkdir()
    trimesh.creation.box((1, 1, 1)).export(folder / "a.gltf")
    whole = json.loads((folder / "a.gltf").read_text())
    read_mesh(folder / "a.gltf")
    (tmp_path / "secret.bin").write_bytes(bytes(10_000))
    (folder / "a.gltf").write_text(json.dumps(whole | {"buffers": [whole["buffers"][0] | {"uri": uri}]}))
    refused(folder / "a.gltf", "outside its folder")


def test_nothing_reaches_for_the_network(tmp_path, monkeypatch):
    def connect(*_):
        raise AssertionError("a connection was tried")

    monkeypatch.setattr(socket.socket, "connect", connect)
    refused(write_obj(tmp_path, mtl="newmtl m\nmap_Kd https://host/a.png\n"), "outside its folder")


def test_faults(tmp_path):
    refused(tmp_path / "none.glb", "cannot be read")
    path = write_obj(tmp_path)
    refused(path, "up 'x' must be y or z", up="x")
    refused(path, "scale -1 positive", scale=-1)
    for suffix in (".pickle", ".ply", ".zip"):
        (tmp_path / f"a{suffix}").write_text("hello")
        refused(tmp_path / f"a{suffix}", "is no mesh by its suffix")
    for name, content in (("b.glb", b"hello"), ("c.glb", b""), ("d.gltf", b"{}"), ("e.obj", b"v 0 0 0\n")):
        (tmp_path / name).write_bytes(content)
        refused(tmp_path / name, "damaged|no triangle")
    flat = "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n"
    (tmp_path / "flat.obj").write_text(flat)
    refused(tmp_path / "flat.obj", "no triangle with an area")
    (tmp_path / "a.png").write_text("hello")
    with pytest.raises(InputError, match=r"a.png cannot be opened as a picture"):
        read_mesh(path)


def textured_gltf(folder):
    """A box in a .glb and a .gltf file, with a picture inside; and the latter's JSON."""
    box = trimesh.creation.box((1, 1, 1))
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=PIL.Image.new("RGB", (8, 8), (255, 0, 0)))
    box.visual = trimesh.visual.TextureVisuals(uv=np.zeros((8, 2)), material=material)
    box.export(folder / "a.glb")
    box.export(folder / "a.gltf")
    return json.loads((folder / "a.gltf").read_text())


def set_base(key, value):
    return lambda tree: tree["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"].update({key: value})


def integer_places(tree):
    place = tree["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"]
    tree["accessors"][place]["componentType"] = 5123


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda tree: tree.update(extensionsRequired=["EXT_meshopt_compression"]), "requires EXT_meshopt_compression"),
        (set_base("texCoord", 1), "second coordinates"),
        (set_base("extensions", {"KHR_texture_transform": {"scale": [2, 2]}}), "KHR_texture_transform"),
        (integer_places, "as integers"),
    ],
)
def test_what_would_be_lost_is_refused(tmp_path, change, message):
    tree = textured_gltf(tmp_path)
    assert len(read_mesh(tmp_path / "a.gltf").textures) == len(read_mesh(tmp_path / "a.glb").textures) == 1
    change(tree)
    (tmp_path / "a.gltf").write_text(json.dumps(tree))
    refused(tmp_path / "a.gltf", message)


def test_a_broken_picture_inside_a_glb_is_refused(tmp_path):
    textured_gltf(tmp_path)
    data = (tmp_path / "a.glb").read_bytes()
    for mark in (b"\x89PNG", b"IDAT"):
        assert mark in data
        (tmp_path / "a.glb").write_bytes(data.replace(mark, b"oops"))
        refused(tmp_path / "a.glb", "holds picture 0, which is no PNG")


def damage(data, rng):
    data = bytearray(data)
    for _ in range(rng.choice([1, 1, 4])):
        data[rng.randrange(min(len(data), rng.choice([200, 2000])))] = rng.randrange(256)
    return data if rng.random() < 0.7 else data[: rng.randrange(len(data))]


@pytest.mark.filterwarnings("ignore")  # NumPy warns of values that only damage brings forth
@pytest.mark.parametrize("name", ["a.glb", "a.gltf", "a.obj"])
def test_damaged_bytes(tmp_path, name):
    write_obj(tmp_path)
    if name != "a.obj":
        textured_gltf(tmp_path)
    whole, rng = (tmp_path / name).read_bytes(), random.Random(name)
    read_mesh(tmp_path / name)
    for _ in range(60):
        (tmp_path / name).write_bytes(damage(whole, rng))
        try:
            read_mesh(tmp_path / name)
        except InputError as error:
            assert str(tmp_path / name) in str(error) and len(str(error).splitlines()) == 1
