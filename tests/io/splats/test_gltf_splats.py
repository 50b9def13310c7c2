"""glTF splats, read back by the letters of the specification; and as splat-transform writes the same scene."""

import json
import struct
from pathlib import Path

import numpy as np
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.geometry.colour import linear_from_srgb
from rein3d_jax.geometry.spherical_harmonics import C0
from rein3d_jax.io.splats.gaussian_file import read_splats
from rein3d_jax.io.splats.gltf_splats import write_gltf_splats
from rein3d_jax.io.splats.up_axis import with_up

PEER = Path(__file__).parent / "splat_transform"
NAME = "KHR_gaussian_splatting"
KINDS = {5126: ("<f4", 4), 5121: ("u1", 1)}
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}


def parsed(path):
    """The header and the attributes (n, width) of a GLB's only primitive, every offset and length checked."""
    data = path.read_bytes()
    magic, version, length, size, kind = struct.unpack_from("<4sIII4s", data)
    assert (magic, version, length, kind) == (b"glTF", 2, len(data), b"JSON") and size % 4 == 0
    binary_size, binary_kind = struct.unpack_from("<I4s", data, 20 + size)
    assert binary_kind == b"BIN\0" and binary_size % 4 == 0 and 28 + size + binary_size == len(data)
    header, binary, found = json.loads(data[20 : 20 + size]), data[28 + size :], {}
    for name, index in header["meshes"][0]["primitives"][0]["attributes"].items():
        accessor = header["accessors"][index]
        view = header["bufferViews"][accessor["bufferView"]]
        kind, item = KINDS[accessor["componentType"]]
        width, start = WIDTHS[accessor["type"]], view["byteOffset"] + accessor.get("byteOffset", 0)
        assert view["byteLength"] == accessor["count"] * width * item and start % 4 == 0
        values = np.frombuffer(binary, kind, accessor["count"] * width, start).reshape(-1, width)
        found[name] = values / 255 if accessor.get("normalized") else values
    return header, found


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    path = tmp_path_factory.mktemp("gltf") / "x.glb"
    write_gltf_splats(path, read_splats(PEER / "scene.ply"))
    return path


def test_it_is_what_the_specification_says(written):
    header, found = parsed(written)
    primitive = header["meshes"][0]["primitives"][0]
    assert primitive["mode"] == 0 and header["extensionsUsed"] == [NAME] and "extensionsRequired" not in header
    told = primitive["extensions"][NAME]
    assert told["kernel"] == "ellipse" and told["colorSpace"] == "srgb_rec709_display"
    scene = with_up(read_splats(PEER / "scene.ply"), "y")
    np.testing.assert_array_equal(found["POSITION"], scene.means)
    bounds = header["accessors"][primitive["attributes"]["POSITION"]]
    np.testing.assert_array_equal([bounds["min"], bounds["max"]], [scene.means.min(0), scene.means.max(0)])
    np.testing.assert_allclose(found[f"{NAME}:ROTATION"][:, [3, 0, 1, 2]], scene.quats, atol=2e-7)  # made unit again
    np.testing.assert_allclose(found[f"{NAME}:SCALE"], np.exp(scene.log_scales), rtol=1e-6)  # float32
    alpha = 1 / (1 + np.exp(-np.float64(scene.opacity_logits)))
    np.testing.assert_allclose(found[f"{NAME}:OPACITY"][:, 0], alpha, rtol=1e-6)
    sh = [found[f"{NAME}:SH_DEGREE_{degree}_COEF_{n}"] for degree in range(4) for n in range(2 * degree + 1)]
    np.testing.assert_array_equal(np.stack(sh, axis=1), scene.sh)
    rgb = linear_from_srgb(np.clip(0.5 + C0 * np.asarray(scene.sh)[:, 0], 0, 1))
    np.testing.assert_allclose(found["COLOR_0"][:, :3], rgb, atol=0.6 / 255)  # half a byte, and float32


def test_splat_transform_makes_the_same_of_the_y_down_ply(written):
    """theirs.y-down.glb: version 3.7.0, of the PLY that we write with up="y-down". It rotates spherical harmonics by
    formulas of its own; COLOR_0 it leaves in sRGB, against the specification."""
    ours, theirs = parsed(written)[1], parsed(PEER / "theirs.y-down.glb")[1]
    assert ours.keys() == theirs.keys()
    order = [np.argmin(np.linalg.norm(theirs["POSITION"] - place, axis=1)) for place in ours["POSITION"]]
    for name in ours.keys() - {"COLOR_0"}:
        wanted = theirs[name][order]
        if name.endswith("ROTATION"):  # of either sign
            wanted = wanted * np.sign((wanted * ours[name]).sum(axis=1, keepdims=True))
        np.testing.assert_allclose(ours[name], wanted, atol=2e-6, err_msg=name)  # float32 through both


def test_what_gltf_cannot_hold_is_refused(tmp_path):
    scene = read_splats(PEER / "scene.ply")
    with pytest.raises(InputError, match=r"x.glb: the scene is empty"):
        write_gltf_splats(tmp_path / "x.glb", scene.replace(alive=np.zeros(7, bool)))
    with pytest.raises(InputError, match=r"x.glb: 3 values of its 7 Gaussians are not finite"):
        write_gltf_splats(tmp_path / "x.glb", scene.replace(means=scene.means.at[0].set(np.nan)))
    assert not list(tmp_path.iterdir())
