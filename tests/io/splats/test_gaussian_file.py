"""Each scene format: what is read is what was written within the format's steps; @playcanvas/splat-transform (2.7.1;
3.7.0 of SPZ, whose axes it turned before) reads ours as we mean it, and we read its own; bad files are refused by name.

splat_transform/ holds scene.ply (seven Gaussians, degree 3), ours.* (our files of it), ours.*.read.ply (what
splat-transform made of them) and theirs.* (what it made of scene.ply; the SPZ with --spz-version 3).
"""

import dataclasses
import gzip
import os
import random
import shutil
import struct
import subprocess
from pathlib import Path

import jax
import numpy as np
import plyfile
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.geometry.spherical_harmonics import C0
from rein3d_jax.io.splats import spz, spz_streams
from rein3d_jax.io.splats.gaussian_columns import alive_columns
from rein3d_jax.io.splats.gaussian_file import read_splats, write_splats
from rein3d_jax.scene import Gaussians

PEER = Path(__file__).parent / "splat_transform"
SUFFIXES = ["ply", "compressed.ply", "spz", "splat"]
N = 600  # three chunks of a compressed PLY, the last one part full
HALF_BYTE = 0.5 / 255


def scene(degree=1, dead=(), count=N):
    rng = np.random.default_rng(degree)
    quats = rng.standard_normal((count, 4))
    alive = np.ones(count, bool)
    alive[list(dead)] = False
    fields = (
        rng.uniform(-3, 3, (count, 3)),
        rng.uniform(-7, 1, (count, 3)),
        quats / np.linalg.norm(quats, axis=-1, keepdims=True),
        rng.uniform(-5, 5, count),
        np.concatenate(
            [rng.uniform(-1.7, 1.7, (count, 1, 3)), rng.uniform(-0.9, 0.9, (count, (degree + 1) ** 2 - 1, 3))], 1
        ),
    )
    return Gaussians(*(field.astype(np.float32) for field in fields), alive)


def matched(got, wanted):
    """Columns of both, each of `got` the nearest by position and colour, so that rounding cannot swap two."""
    a, b = alive_columns(got, ""), alive_columns(wanted, "")
    far = np.abs(a.means[None] - b.means[:, None]).max(-1)
    chosen = far.argmin(axis=1)
    assert sorted(chosen) == list(range(len(b.means)))
    return type(a)(*(field[chosen] for field in a)), b


def alpha(logits):
    return 1 / (1 + np.exp(-logits.astype(np.float64)))


def angle_between(a, b):
    """Radians between two rotations (n, 4), where a splat 180 degrees about one of its own axes is the same."""
    w, x, y, z = a.T.astype(np.float64)
    same = np.stack([(w, x, y, z), (-x, w, z, -y), (-y, -z, w, x), (-z, y, -x, w)])
    sine = np.sqrt(np.maximum(0, 1 - (same * b.T).sum(axis=1) ** 2)).min(axis=0)
    return 2 * np.arcsin(sine)


# Largest error of a position (m), log scale, rotation (radians), colour coefficient, coefficients above degree 0.
# A rotation is off by the vector of its stored components' errors, twice that as an angle; sqrt for three or four.
TINY = 1e-5  # float32 arithmetic
BOUNDS = {
    "ply": (0, 0, 1e-3, 0, 0),  # the angle of two quaternions equal to 1e-7: arccos near 1 squares it
    # 1/2 of 1/4096 m; 1/2 of 1/16; three of 9 bits in [0, 1] / sqrt(2), the fourth >= 1/2 amplifies by 1/w; 1/2 of
    # 1/(255 * 0.15); half of 16/128, or all of 15/128 at the top: 255 stands for 256
    "spz": (0.5 / 4096, 0.5 / 16, 2 * 2 * np.sqrt(3) * 0.5 * np.sqrt(0.5) / 511, HALF_BYTE / 0.15, 8 / 128),
    # floats; u8 w x y z in steps of 1/128, where 1 is held as 127/128; colour in [0, 1]
    "splat": (0, 0, 2 * np.sqrt(4) / 128, HALF_BYTE / C0, None),
    # 10 bits of a chunk as wide as the scene (6 m; 8 in log scale; 3.4 in colour coefficients) at most; three of 10
    # bits in [-1, 1] / sqrt(2), the fourth is the largest, >= 1/2; f_rest in steps of 8/256
    "compressed.ply": (3 / 1023, 4 / 1023, 2 * 2 * np.sqrt(3) * np.sqrt(0.5) / 1023, 1.7 / 255, 4 / 256),
}


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_round_trip_within_the_steps_of_the_format(tmp_path, suffix, degree):
    wanted = scene(degree, dead=(0, 3))
    if suffix == "splat":
        degree = 0
    path = tmp_path / f"x.{suffix}"
    write_splats(path, wanted)
    got = read_splats(path)
    assert got.alive.all() and got.means.shape == (N - 2, 3) and got.sh.shape == (N - 2, (degree + 1) ** 2, 3)
    close(got, wanted, BOUNDS[suffix])


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_the_antialias_flag_changes_nothing_else(tmp_path, suffix):
    plain, flagged = tmp_path / f"a.{suffix}", tmp_path / f"b.{suffix}"
    write_splats(plain, scene(1))
    write_splats(flagged, scene(1), antialias=True)
    for a, b in zip(*(jax.tree.leaves(read_splats(path)) for path in (plain, flagged)), strict=True):
        np.testing.assert_array_equal(a, b)
    if suffix == "ply":
        assert plyfile.PlyData.read(flagged).comments == ["Z up, metres, right-handed", "SplatRenderMode: mip"]
    elif suffix == "spz":
        flags = [gzip.decompress(path.read_bytes())[14] for path in (plain, flagged)]
        assert flags == [0, 1]  # the reference's FlagAntialiased
    else:
        assert plain.read_bytes() == flagged.read_bytes()


def close(got, wanted, bounds):
    a, b = matched(got, wanted)
    place, scale, angle, colour, rest = bounds
    assert np.abs(a.means - b.means).max() <= place + TINY
    assert np.abs(a.log_scales - b.log_scales).max() <= scale + TINY
    assert angle_between(a.quats, b.quats).max() <= angle + TINY
    assert np.abs(alpha(a.opacity_logits) - alpha(b.opacity_logits)).max() <= HALF_BYTE + TINY
    assert np.abs(a.sh[:, 0] - b.sh[:, 0]).max() <= colour + TINY
    if rest is not None and a.sh.shape == b.sh.shape:
        assert np.abs(a.sh[:, 1:] - b.sh[:, 1:]).max(initial=0) <= rest + TINY


@pytest.mark.parametrize("suffix", SUFFIXES[1:])
def test_splat_transform_reads_ours_as_we_do(tmp_path, suffix):
    """Its readings are stored; that we still write the same is the first line."""
    wanted = read_splats(PEER / "scene.ply")
    write_splats(tmp_path / f"x.{suffix}", wanted)
    ours = (tmp_path / f"x.{suffix}").read_bytes(), (PEER / f"ours.{suffix}").read_bytes()
    assert len({gzip.decompress(data) if suffix == "spz" else data for data in ours}) == 1
    theirs = read_splats(PEER / f"ours.{suffix}.read.ply")
    close(read_splats(PEER / f"ours.{suffix}"), theirs, (0, 0, 0.02, 1e-6, 1e-6))  # .splat: they centre a byte at 127.5
    close(theirs, wanted, BOUNDS[suffix])


@pytest.mark.parametrize("name", ["theirs.compressed.ply", "theirs.spz"])
def test_we_read_what_splat_transform_writes(name):
    place, scale, angle, colour, rest = BOUNDS[name.removeprefix("theirs.")]
    bounds = (place, scale, angle, colour, rest + 1 / 128)  # it rounds SH to 1/128 first
    close(read_splats(PEER / name), read_splats(PEER / "scene.ply"), bounds)


@pytest.mark.skipif(
    not shutil.which("splat-transform"), reason="npm install --global @playcanvas/splat-transform@3.7.0"
)
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_splat_transform_reads_a_larger_scene(tmp_path, suffix):
    wanted = scene(3)
    write_splats(tmp_path / f"x.{suffix}", wanted)
    subprocess.run(["splat-transform", "-q", tmp_path / f"x.{suffix}", tmp_path / "y.ply"], check=True)
    close(read_splats(tmp_path / "y.ply"), wanted, BOUNDS[suffix])


def test_plyfile_reads_a_compressed_ply(tmp_path):
    write_splats(tmp_path / "x.compressed.ply", scene(1))
    ply = plyfile.PlyData.read(tmp_path / "x.compressed.ply")
    assert [(e.name, e.count, len(e.properties)) for e in ply.elements] == [
        ("chunk", 3, 18),
        ("vertex", N, 4),
        ("sh", N, 9),
    ]
    assert ply["vertex"].data.dtype == np.dtype(
        [(f"packed_{n}", "<u4") for n in ("position", "rotation", "scale", "color")]
    )


def test_a_compressed_ply_named_ply_is_read_too(tmp_path):
    write_splats(tmp_path / "x.compressed.ply", scene(1))
    shutil.copy(tmp_path / "x.compressed.ply", tmp_path / "y.ply")
    np.testing.assert_array_equal(
        read_splats(tmp_path / "y.ply").means, read_splats(tmp_path / "x.compressed.ply").means
    )


def test_a_chunk_without_colour_bounds_is_read(tmp_path):
    """As SuperSplat wrote them before 2024: colours are in [0, 1]."""
    wanted = scene(0, count=3)
    write_splats(tmp_path / "x.compressed.ply", wanted)
    head, mark, body = (tmp_path / "x.compressed.ply").read_bytes().partition(b"end_header\n")
    for name in ("min_r", "min_g", "min_b", "max_r", "max_g", "max_b"):
        head = head.replace(f"property float {name}\n".encode(), b"")
    words = bytearray(body[72:])
    words[12:16] = struct.pack("<I", 255 << 24 | 51 << 8 | 128)  # the first: red 1, green 0, blue 0.2
    (tmp_path / "x.compressed.ply").write_bytes(head + mark + body[:48] + words)
    rgb = 0.5 + C0 * np.asarray(read_splats(tmp_path / "x.compressed.ply").sh)[0, 0]
    np.testing.assert_allclose(rgb, [1, 0, 0.2], atol=1e-6)


@pytest.mark.parametrize("version", [3, 4])
def test_an_spz_holds_a_ply_s_numbers(tmp_path, version):
    """The header aside, its first bytes are x y z in 1/4096 m, unpacked by hand: no axis is turned."""
    wanted = scene(1)
    spz.write_spz(tmp_path / "x.spz", wanted, version=version)
    _, (fixed, *_) = spz_streams.unpack_spz(tmp_path / "x.spz")
    low, middle, high = (fixed[:, byte::3].astype(int) for byte in range(3))
    metres = (low + 256 * middle + 65536 * np.where(high < 128, high, high - 256)) / 4096
    np.testing.assert_allclose(metres, wanted.means, atol=0.5 / 4096 + TINY)


@pytest.mark.parametrize("far", [1500.0, 100_000.0, 8_000_000.0])
def test_a_large_spz_keeps_what_24_bits_hold(tmp_path, far):
    wanted = scene(0, count=2)
    wanted.means[1] = far
    write_splats(tmp_path / "x.spz", wanted)
    got = np.asarray(read_splats(tmp_path / "x.spz").means)
    np.testing.assert_allclose(got, wanted.means, atol=max(2.0 * far / 2**23, 0.5 / 4096))  # a step is <= 2 far / 2^23
    wanted.means[1] = 1e7
    with pytest.raises(InputError, match=r"x.spz reaches 1e\+07 m, .* write a PLY"):
        write_splats(tmp_path / "x.spz", wanted)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_an_empty_scene_round_trips(tmp_path, suffix):
    write_splats(tmp_path / f"x.{suffix}", scene(0, dead=range(N)))
    assert read_splats(tmp_path / f"x.{suffix}").sh.shape == (0, 1, 3)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_extreme_scenes_are_read_back(tmp_path, suffix):
    """Certain opacities, points, one place for all: each finite again."""
    wanted = scene(1, count=4)
    wanted = dataclasses.replace(wanted, means=np.ones((4, 3), np.float32))
    wanted.opacity_logits[:] = 80, -80, 0, 0
    wanted.log_scales[:] = np.float32([[-100, -100, -100], [9, 9, 9], [0, -100, 0], [0, 0, 0]])
    write_splats(tmp_path / f"x.{suffix}", wanted)
    got = read_splats(tmp_path / f"x.{suffix}")
    assert np.abs(np.asarray(got.means) - 1).max() <= 0.5 / 4096  # SPZ's step
    assert alpha(np.asarray(got.opacity_logits)).max() > 0.998 and alpha(np.asarray(got.opacity_logits)).min() < 0.002


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_nothing_is_written_of_values_that_are_not_finite(tmp_path, suffix):
    bad = scene(1)
    bad.means[2, 1] = np.nan
    with pytest.raises(InputError, match="1 values of its 600 Gaussians are not finite"):
        write_splats(tmp_path / f"x.{suffix}", bad)
    assert not os.listdir(tmp_path)


def test_unknown_suffixes(tmp_path):
    for act in (read_splats, lambda path: write_splats(path, scene())):
        with pytest.raises(InputError, match=r"x.obj has no scene format .* .compressed.ply, .ply, .spz, .splat"):
            act(tmp_path / "x.obj")


def refused(path, data, message):
    path.write_bytes(data)
    with pytest.raises(InputError, match=message) as caught:
        read_splats(path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_bad_spz(tmp_path):
    path = tmp_path / "x.spz"
    with pytest.raises(InputError, match=r"x.spz cannot be read"):
        read_splats(path)
    write_splats(path, scene(1, count=9))
    whole = path.read_bytes()
    plain = bytearray(gzip.decompress(whole))

    def changed(at, kind, value):
        data = bytearray(plain)
        struct.pack_into(kind, data, at, value)
        return gzip.compress(data)

    refused(path, b"hello", "damaged or no SPZ file")
    refused(path, b"", "does not begin like")
    refused(path, gzip.compress(b"NGSP"), "does not begin like")
    refused(path, gzip.compress(b"hello" * 99), "does not begin like")
    refused(path, whole[:-9], "declares 9 Gaussians and holds less")
    refused(path, whole[:-1], "declares 9 Gaussians and holds less")  # the checksum is cut
    refused(path, whole[:60] + b"\xff" * 9 + whole[69:], "damaged")
    refused(path, changed(4, "<I", 5), "SPZ version 5, .*: export it as version 3")
    refused(path, changed(12, "<B", 5), "SH degree 5")
    refused(path, changed(12, "<B", 4), "declares 9 Gaussians and holds less")
    refused(path, changed(13, "<B", 40), "40 fractional bits")
    refused(path, changed(8, "<I", 8), "declares 8 Gaussians and holds more")
    refused(path, changed(8, "<I", 10), "declares 10 Gaussians and holds less")
    refused(path, changed(8, "<I", 4_000_000_000), "declares 4000000000 Gaussians in")  # 112 GB, never allocated


def test_an_spz_bomb_is_not_unpacked(tmp_path, monkeypatch):
    """A megabyte that unpacks to a gigabyte: refused after one byte more than it declares."""
    header = struct.pack("<4sIIBBBB", b"NGSP", 2, 5, 0, 12, 0, 0)
    bomb = gzip.compress(header + bytes(64 * 2**20), 9)
    asked = []
    create = spz_streams.zlib.decompressobj

    class Counting:
        def __init__(self, wbits):
            self.inner = create(wbits)

        def __getattr__(self, name):
            return getattr(self.inner, name)

        def decompress(self, data, most):
            found = self.inner.decompress(data, most)
            asked.append(len(found))
            return found

    monkeypatch.setattr(spz_streams.zlib, "decompressobj", Counting)
    refused(tmp_path / "x.spz", bomb, "declares 5 Gaussians and holds more")
    assert sum(asked) <= 16 + 5 * 19 + 2


def test_bad_splat(tmp_path):
    path = tmp_path / "x.splat"
    write_splats(path, scene(0, count=3))
    whole = path.read_bytes()
    refused(path, whole[:-1], "95 bytes, no multiple of 32: it is cut short")
    refused(path, whole[:4] + struct.pack("<f", np.nan) + whole[8:], "1 values of its 3 Gaussians are not finite")
    refused(path, whole[:12] + struct.pack("<f", -1) + whole[16:], "1 scales below 0")
    refused(path, (whole[:28] + b"\x80\x80\x80\x80") * 3, "3 have a quaternion of zeros, so that none is left")


def test_bad_compressed_ply(tmp_path):
    path = tmp_path / "x.compressed.ply"
    write_splats(path, scene(1))
    whole = path.read_bytes()
    start = whole.index(b"end_header\n") + 11
    nan = struct.pack("<f", np.nan)
    refused(path, whole[:-1], "declares 600 Gaussians in 3 chunks, .* but has")
    refused(path, whole.replace(b"vertex 600", b"vertex 999999999999"), "no compressed PLY's header")  # sh says 600
    refused(path, whole.replace(b" 600", b" 999999999999"), "declares 999999999999 Gaussians in 3 chunks")
    refused(path, whole.replace(b"chunk 3", b"chunk 2"), "declares 600 Gaussians in 2 chunks")
    refused(path, whole.replace(b"chunk 3", b"chunk x"), "no compressed PLY's header")
    refused(path, whole.replace(b"uint packed_scale", b"uint packed_scalx"), "no compressed PLY's header")
    refused(path, whole.replace(b"end_header", b"end_hxader"), "no PLY file")
    refused(path, whole[:start] + nan + whole[start + 4 :], "256 values of its 600 Gaussians are not finite")


@pytest.mark.filterwarnings("ignore")  # NumPy warns of values that only damage brings forth
@pytest.mark.parametrize("suffix", SUFFIXES[1:])
def test_damaged_bytes(tmp_path, suffix):
    """Whatever bytes a file holds, a reader returns a finite scene or raises an InputError of one line."""
    path, rng = tmp_path / f"x.{suffix}", random.Random(suffix)
    write_splats(path, scene(1, count=40))
    whole = path.read_bytes()
    plain = gzip.decompress(whole) if suffix == "spz" else whole
    for round in range(80):
        inside = suffix == "spz" and round % 2  # damage under the gzip too
        data = bytearray(plain if inside else whole)
        for _ in range(rng.choice([1, 1, 4])):
            data[rng.randrange(min(len(data), rng.choice([100, 2000])))] = rng.randrange(256)
        data = data if rng.random() < 0.7 else data[: rng.randrange(len(data))]
        path.write_bytes(gzip.compress(data) if inside else data)
        try:
            got = read_splats(path)
        except InputError as error:
            assert str(path) in str(error) and len(str(error).splitlines()) == 1
        else:
            assert all(np.isfinite(field).all() for field in (got.means, got.log_scales, got.quats, got.sh))
