"""PLY scenes round trip and are read equal by plyfile, an independent reader; bad files are refused by name."""

import os

import numpy as np
import plyfile
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.io.splats.ply import read_ply, write_ply
from rein3d_jax.scene import Gaussians

N = 7


def scene(degree=1, dead=()):
    rng = np.random.default_rng(degree)
    normal = lambda *shape: rng.standard_normal((N, *shape)).astype(np.float32)  # noqa: E731
    quats = normal(4)
    alive = np.ones(N, bool)
    alive[list(dead)] = False
    unit = quats / np.linalg.norm(quats, axis=-1, keepdims=True)
    return Gaussians(normal(3), normal(3), unit, normal(), normal((degree + 1) ** 2, 3), alive)


def rewrite(path, old, new):
    data = path.read_bytes()
    assert old in data
    path.write_bytes(data.replace(old, new, 1))


def refused(path, message):
    with pytest.raises(InputError, match=message) as caught:
        read_ply(path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_round_trip(tmp_path, degree):
    wanted = scene(degree)
    write_ply(tmp_path / "x.ply", wanted)
    got = read_ply(tmp_path / "x.ply")
    for name in ("means", "log_scales", "opacity_logits", "sh", "alive"):
        np.testing.assert_array_equal(getattr(got, name), getattr(wanted, name))
    np.testing.assert_allclose(got.quats, wanted.quats, atol=2e-7)  # normalised once more in float32


def test_plyfile_reads_the_standard_layout(tmp_path):
    wanted = scene(2)
    write_ply(tmp_path / "x.ply", wanted)
    ply = plyfile.PlyData.read(tmp_path / "x.ply")
    vertex = ply["vertex"]
    assert not ply.text and ply.byte_order == "<" and len(vertex.data) == N
    names = [p.name for p in vertex.properties]
    rest = [f"f_rest_{i}" for i in range(24)]
    standard = ["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", *rest, "opacity"]
    assert names == [*standard, "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
    columns = {name: np.asarray(vertex[name]) for name in names}
    stack = lambda stem, n: np.stack([columns[f"{stem}_{i}"] for i in range(n)], -1)  # noqa: E731
    np.testing.assert_array_equal(np.stack([columns[a] for a in "xyz"], -1), wanted.means)
    np.testing.assert_array_equal(stack("scale", 3), wanted.log_scales)
    np.testing.assert_array_equal(stack("rot", 4), wanted.quats)
    np.testing.assert_array_equal(columns["opacity"], wanted.opacity_logits)
    np.testing.assert_array_equal(stack("f_dc", 3), wanted.sh[:, 0])
    for channel in range(3):
        for k in range(8):  # channel-major: all of red, then green, then blue
            np.testing.assert_array_equal(columns[f"f_rest_{8 * channel + k}"], wanted.sh[:, 1 + k, channel])
    assert not (columns["nx"].any() or columns["ny"].any() or columns["nz"].any())


def test_only_alive_slots_are_written(tmp_path):
    wanted = scene(1, dead=(0, 3))
    wanted.means[3] = np.nan  # a dead slot's values do not matter
    write_ply(tmp_path / "x.ply", wanted)
    got = read_ply(tmp_path / "x.ply")
    assert got.means.shape == (N - 2, 3) and got.alive.all()
    np.testing.assert_array_equal(got.means, wanted.means[wanted.alive])


def test_an_empty_scene_round_trips(tmp_path):
    write_ply(tmp_path / "x.ply", scene(1, dead=range(N)))
    assert read_ply(tmp_path / "x.ply").sh.shape == (0, 4, 3)


def test_other_order_types_and_elements_are_read(tmp_path):
    """As plyfile writes them: doubles, shuffled, one property more, faces after the vertices, quaternions not unit."""
    wanted = scene(0)
    values = dict(zip("zyx", wanted.means.T[::-1], strict=True), extra=np.arange(N), opacity=wanted.opacity_logits)
    for stem, field in (("rot", 3 * wanted.quats), ("f_dc", wanted.sh[:, 0]), ("scale", wanted.log_scales)):
        values |= {f"{stem}_{i}": field[:, i] for i in range(field.shape[1])}
    table = np.empty(N, [(name, "u1" if name == "extra" else "f8") for name in values])
    for name, column in values.items():
        table[name] = column
    face = np.zeros(2, [("a", "i4")])
    elements = [plyfile.PlyElement.describe(table, "vertex"), plyfile.PlyElement.describe(face, "face")]
    plyfile.PlyData(elements, byte_order="<", comments=["hello"]).write(tmp_path / "x.ply")
    got = read_ply(tmp_path / "x.ply")
    np.testing.assert_array_equal(got.means, wanted.means)
    np.testing.assert_allclose(got.quats, wanted.quats, atol=2e-7)  # times 3, then normalised, in float32
    np.testing.assert_array_equal(got.sh, wanted.sh)


@pytest.mark.parametrize("wild", [np.nan, np.inf])
def test_values_that_are_not_finite_are_counted(tmp_path, wild):
    bad = scene(1)
    bad.means[2, 1] = bad.sh[4, 0, 0] = wild
    with pytest.raises(InputError, match=r"x.ply: 2 values of its 7 Gaussians are not finite"):
        write_ply(tmp_path / "x.ply", bad)
    assert not os.listdir(tmp_path)
    write_ply(tmp_path / "x.ply", scene(0))
    data = bytearray((tmp_path / "x.ply").read_bytes())
    data[-4:] = np.float32(wild).tobytes()
    (tmp_path / "x.ply").write_bytes(data)
    refused(tmp_path / "x.ply", "1 values of its 7")


def test_bad_files(tmp_path):
    path = tmp_path / "x.ply"
    refused(path, "cannot be read")
    path.write_text("hello")
    refused(path, "no PLY file of version 1.0")
    cases = [
        (b"binary_little_endian", b"binary_middle_endian", "no PLY file of version 1.0"),
        (b"property float opacity", b"property float opacitx", "lacks the properties opacity"),
        (b"property float f_rest_8\n", b"", "8 f_rest properties: export it with SH degree 0 to 3"),
        (b"property float f_rest_8\n", b"property float f_rest_9\n", "lacks the properties f_rest_8"),
        (b"property float y", b"property float x", "no scene's"),
        (b"property float y", b"property list uchar int y", "list property y in its element vertex"),
        (b"property float y", b"property quad y", "no scene's"),
        (b"vertex 7", b"vertex -7", "no scene's"),
        (b"element vertex", b"element face", "no scene's"),
        (b"vertex 7", b"vertex 8", "declares 8 vertices but holds 7"),
        (b"vertex 7", b"vertex 999999999999", "declares 999999999999 vertices"),  # 100 TB, never allocated
        (b"end_header", b"end_hxader", "no PLY file"),
    ]
    for old, new, message in cases:
        write_ply(path, scene(1))
        rewrite(path, old, new)
        refused(path, message)


def test_truncated_and_quaternions_without_direction(tmp_path):
    path = tmp_path / "x.ply"
    write_ply(path, scene(1))
    os.truncate(path, path.stat().st_size - 1)
    refused(path, "holds 6: it is cut short")
    broken = scene(1)
    broken.quats[1] = 3e38  # its length overflows float32
    write_ply(path, broken)
    refused(path, "1 quaternions without a direction")


def test_disk_full_keeps_the_earlier_file(tmp_path, file_size_limit):
    path = tmp_path / "x.ply"
    write_ply(path, scene(1))
    earlier = path.read_bytes()
    with file_size_limit(600), pytest.raises(InputError, match=r"x.ply cannot be written .*free some space"):
        write_ply(path, scene(2))
    assert path.read_bytes() == earlier and os.listdir(tmp_path) == ["x.ply"]
