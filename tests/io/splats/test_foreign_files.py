"""Scenes as other tools write them: each is read as the same scene saved plainly, or refused by what is at fault."""

import gzip
import random
import struct

import numpy as np
import plyfile
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.geometry.spherical_harmonics import C0
from rein3d_jax.io.splats.gaussian_file import read_splats, write_splats

N = 6
PLAIN = [*"xyz", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "opacity"]
PLAIN += ["scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
HIDES = "list property parts in its element {}, which hides"


def scene(rest=0, **changed):
    """Columns by name, float32; `changed` gives a property's first values."""
    names = [*PLAIN[:9], *(f"f_rest_{i}" for i in range(rest)), *PLAIN[9:]]
    values = np.random.default_rng(rest).uniform(-1, 1, (len(names), N)).astype(np.float32)
    columns = dict(zip(names, values, strict=True))
    for name, first in changed.items():
        columns[name][: len(first)] = first
    return columns


def ply(columns=None, before="", after="", **how):
    """The bytes of a PLY; `before` and `after` name a further element of two rows, `lists` makes it one of lists."""
    columns = scene() if columns is None else columns
    kind, end, lists = how.get("kind", "binary_little_endian"), how.get("end", "\n"), how.get("lists", False)
    types = {"f4": "float", "f8": "double", "u1": "uchar"}
    lines = ["ply", f"format {kind} 1.0", "comment not yet end_header"]
    parts = []
    for name in filter(None, (before, "vertex", after)):
        own = columns if name == "vertex" else {"parts": np.float32([1, 2])}
        lines.append(f"element {name} {len(next(iter(own.values())))}")
        if name != "vertex" and lists:
            lines.append("property list uchar float parts")
            own = {"size": np.ones(2, "u1"), **own}
        else:
            lines += [f"property {types[column.dtype.str[1:]]} {each}" for each, column in own.items()]
        parts.append(rows(own, kind, end))
    return end.join([*lines, "end_header", ""]).encode() + b"".join(parts)


def rows(columns, kind, end):
    if kind == "ascii":
        return "".join(" ".join(map(str, row)) + f" {end}" for row in zip(*columns.values(), strict=True)).encode()
    order = "<>"[kind == "binary_big_endian"]
    table = np.rec.fromarrays(
        list(columns.values()), [(name, order + column.dtype.str[1:]) for name, column in columns.items()]
    )
    return table.tobytes()


def shuffled():
    columns = scene() | {"segment": np.arange(N, dtype="u1")}
    return {name: columns[name] for name in np.random.default_rng(0).permutation(list(columns))}


def in_rgb(levels=(0, 128, 255)):
    columns = {name: column for name, column in scene().items() if not name.startswith("f_dc")}
    return columns | {
        name: np.full(N, level, "u1") for name, level in zip(("red", "green", "blue"), levels, strict=True)
    }


def spz_1():
    """Version 1 of the reference library: positions are half floats."""
    metres = np.float16([[1, 2, 3], [-0.5, 0.25, 100]])
    data = struct.pack("<4sIIBBBB", b"NGSP", 1, 2, 0, 12, 0, 0) + metres.astype("<f2").tobytes() + bytes([128] * 20)
    return gzip.compress(data, mtime=0)  # a test's name holds it: with the time two workers would know two tests


def read(tmp_path, data, suffix="ply"):
    (tmp_path / f"x.{suffix}").write_bytes(data)
    return read_splats(tmp_path / f"x.{suffix}")


def arrays(gaussians):
    return {
        name: np.asarray(getattr(gaussians, name)) for name in ("means", "log_scales", "quats", "opacity_logits", "sh")
    }


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "data",
    [
        pytest.param(ply(kind="ascii"), id="ascii"),
        pytest.param(ply(kind="ascii", before="face", lists=True, end="\r\n"), id="ascii_lists_first"),
        pytest.param(ply(kind="binary_big_endian", before="camera"), id="bigendian"),
        pytest.param(ply(before="camera"), id="camera_first"),
        pytest.param(ply(before="face", lists=True).replace(b"face 2", b"face 0").replace(rows(
            {"size": np.ones(2, "u1"), "parts": np.float32([1, 2])}, "", ""), b""), id="no_faces_first"),
        pytest.param(ply(end="\r\n"), id="crlf"),
        pytest.param(ply({name: column.astype("f8") for name, column in scene().items()}), id="double"),
        pytest.param(ply({k: v for k, v in scene().items() if k not in ("nx", "ny", "nz")}), id="no_normals"),
        pytest.param(ply(after="extrinsic"), id="sharp_elements"),
        pytest.param(ply(after="face", lists=True), id="faces_last"),
        pytest.param(ply(shuffled()), id="shuffled_extra"),
    ],
)  # fmt: skip
def test_the_same_scene_is_read(tmp_path, data):
    wanted = arrays(read(tmp_path, ply()))
    for name, field in arrays(read(tmp_path, data)).items():
        np.testing.assert_array_equal(field, wanted[name])
    np.testing.assert_array_equal(wanted["means"][:, 1], scene()["y"])
    if b"list" not in data:  # an independent reader agrees that these are PLY files
        np.testing.assert_array_equal(plyfile.PlyData.read(tmp_path / "x.ply")["vertex"]["opacity"], scene()["opacity"])


def test_certain_opacities_and_flat_splats_become_finite(tmp_path):
    columns = scene(opacity=[np.inf, -np.inf], scale_1=[-np.inf, 0, -np.inf], rot_0=[0, 0, 0, 1])
    for name in ("rot_0", "rot_1", "rot_2", "rot_3"):
        columns[name][4] = 0
    with pytest.warns(
        UserWarning, match="x.ply: of its 6 Gaussians 1 have opacity 0 and 1 have a quaternion of zeros; these"
    ):
        got = arrays(read(tmp_path, ply(columns)))
    kept = [0, 2, 3, 5]
    np.testing.assert_array_equal(got["means"][:, 0], columns["x"][kept])
    assert all(np.isfinite(field).all() for field in got.values())
    assert 1 / (1 + np.exp(-got["opacity_logits"][0])) >= 1 - 2**-23  # float32's step
    assert (np.exp(got["log_scales"][:2, 1]) < 1e-6).all()  # a micrometre
    untouched = np.isfinite(columns["scale_1"][kept])
    np.testing.assert_array_equal(got["log_scales"][untouched, 1], columns["scale_1"][kept][untouched])


@pytest.mark.parametrize("degree", [0, 1, 2, 3, 4, 5])
def test_of_high_degrees_the_first_are_read(tmp_path, degree, recwarn):
    higher = (degree + 1) ** 2 - 1
    columns = scene(3 * higher)
    got = arrays(read(tmp_path, ply(columns)))["sh"]
    assert got.shape == (N, min(16, higher + 1), 3)
    for channel in range(3):
        for k in range(got.shape[1] - 1):
            np.testing.assert_array_equal(got[:, 1 + k, channel], columns[f"f_rest_{channel * higher + k}"])
    assert [f"SH degree {degree}" in str(each.message) for each in recwarn] == [True] * (degree > 3)


def test_colours_in_bytes(tmp_path):
    sh = arrays(read(tmp_path, ply(in_rgb((0, 128, 255)))))["sh"]
    np.testing.assert_allclose(0.5 + C0 * sh, np.broadcast_to([0, 128 / 255, 1], (N, 1, 3)), atol=1e-6)  # float32
    both = scene() | in_rgb()
    np.testing.assert_array_equal(arrays(read(tmp_path, ply(both)))["sh"][:, 0, 2], both["f_dc_2"])


def test_a_compressed_ply_with_crlf(tmp_path):
    wanted = read(tmp_path, ply())
    write_splats(tmp_path / "x.compressed.ply", wanted)
    plain = arrays(read_splats(tmp_path / "x.compressed.ply"))
    head, mark, body = (tmp_path / "x.compressed.ply").read_bytes().partition(b"end_header\n")
    got = arrays(read(tmp_path, (head + mark).replace(b"\n", b"\r\n") + body))
    for name, field in got.items():
        np.testing.assert_array_equal(field, plain[name])


def test_spz_of_version_1(tmp_path):
    got = arrays(read(tmp_path, spz_1(), "spz"))
    np.testing.assert_array_equal(got["means"], [[1, 2, 3], [-0.5, 0.25, 100]])
    assert got["sh"].shape == (2, 1, 3) and np.isfinite(got["quats"]).all()


@pytest.mark.parametrize(
    ("suffix", "data", "message"),
    [
        ("ksplat", bytes(5000), r"is a .ksplat scene, .* convert it to .ply, with"),
        ("sog", b"PK\3\4" + bytes(100), r"is a .sog scene, .* convert it to .ply, with"),
        ("SOG", b"", r"is a .sog scene"),
        ("lcc", b"", r"is a .lcc scene"),
        ("spz", b"NGSP" + struct.pack("<I", 5) + bytes(200), "version 5, .* convert"),
        ("spz", gzip.decompress(spz_1()), "version 1, unpacked: pack it with gzip"),
        ("spz", spz_1()[:-10], "declares 2 Gaussians and holds less"),
        ("ply", ply(before="face", lists=True), HIDES.format("face")),
        ("ply", ply().replace(b"property float nz", b"property list uchar float parts"), HIDES.format("vertex")),
        ("ply", ply(scene(71)), "has 71 f_rest properties"),
        ("ply", ply(scene(opacity=[np.nan])), "1 values of its 6 Gaussians are not finite"),
        ("ply", ply(scene(scale_0=[np.inf])), "1 values of its 6 Gaussians are not finite"),
        ("ply", ply(scene(opacity=[-np.inf] * N)), "so that none is left"),
        ("ply", ply(before="camera").replace(b"camera 2", b"camera 999999999999"), "holds 0: it is cut short"),
        ("ply", ply()[:-1], "declares 6 vertices but holds 5: it is cut short"),
        ("ply", ply(kind="ascii").replace(b"vertex 6", b"vertex 7"), "declares 7 vertices but holds 6"),
        ("ply", ply(kind="ascii").replace(b"vertex 6", b"vertex 999999999999"), "holds at most"),  # never allocated
        ("ply", ply(kind="ascii").replace(b" 0.", b" 0,"), "x.ply is damaged"),
        ("ply", ply(kind="ascii").rpartition(b" 0.")[0], "x.ply is damaged"),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_named(tmp_path, suffix, data, message):
    with pytest.raises(InputError, match=message) as caught:
        read(tmp_path, data, suffix)
    assert f"x.{suffix}" in str(caught.value) and len(str(caught.value).splitlines()) == 1


@pytest.mark.filterwarnings("ignore")  # NumPy warns of values that only damage brings forth
@pytest.mark.parametrize("how", [{"kind": "ascii"}, {"kind": "binary_big_endian"}, {"end": "\r\n"}], ids=str)
def test_damaged_bytes(tmp_path, how):
    """Whatever bytes a file holds, a reader returns a finite scene or raises an InputError of one line."""
    whole, rng = ply(scene(9), before="camera", **how), random.Random(0)
    for _ in range(100):
        data = bytearray(whole)
        for _ in range(rng.choice([1, 1, 4])):
            data[rng.randrange(min(len(data), rng.choice([100, 4000])))] = rng.randrange(256)
        try:
            got = read(tmp_path, data if rng.random() < 0.7 else data[: rng.randrange(len(data))])
        except InputError as error:
            assert "x.ply" in str(error) and len(str(error).splitlines()) == 1
        else:
            assert all(np.isfinite(field).all() for field in arrays(got).values())
