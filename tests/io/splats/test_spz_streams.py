"""SPZ's container: version 4's streams as the reference's papers lay them out, extensions, and what is refused."""

import gzip
import struct
import sys
from pathlib import Path

import numpy as np
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.io.splats.gaussian_file import read_splats
from rein3d_jax.io.splats.spz import encode_spz, write_spz
from rein3d_jax.io.splats.spz_streams import SpzHeader, pack_spz

PEER = Path(__file__).parent / "splat_transform"
FIELDS = ("means", "log_scales", "quats", "opacity_logits", "sh")


def read(tmp_path, data):
    (tmp_path / "x.spz").write_bytes(data)
    return read_splats(tmp_path / "x.spz")


def equal(a, b):
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)


@pytest.fixture
def scene():
    return read_splats(PEER / "scene.ply")


def test_versions_3_and_4_hold_the_same_numbers(tmp_path, scene):
    equal(*(read(tmp_path, encode_spz(scene, version=version)) for version in (3, 4)))
    nothing = scene.replace(alive=np.zeros(7, bool))
    assert read(tmp_path, encode_spz(nothing, version=4)).means.shape == (0, 3)


def test_a_file_of_the_reference_library(tmp_path, scene):
    """theirs.v4.spz: splat-transform 3.7.0, whose backend is nianticlabs/spz. It rounds SH to 1/128 first."""
    theirs, ours = read_splats(PEER / "theirs.v4.spz"), read(tmp_path, encode_spz(scene, version=4))
    order = [np.argmin(np.linalg.norm(theirs.means - place, axis=1)) for place in ours.means]
    equal(*(g.replace(sh=g.sh[:, :1], quats=0 * g.quats) for g in (ours, theirs.replace(
        **{name: getattr(theirs, name)[np.array(order)] for name in FIELDS}))))  # fmt: skip
    np.testing.assert_allclose(np.abs((ours.quats * theirs.quats[np.array(order)]).sum(1)), 1, atol=1e-5)  # 10 bits
    np.testing.assert_allclose(ours.sh, theirs.sh[np.array(order)], atol=17 / 128)  # a step of 16, and of 1


def test_degree_4_is_read_up_to_3(tmp_path, scene):
    count = 5
    header = SpzHeader(4, count, 4, 12, True)
    blocks = [np.full((count, width), 128, np.uint8) for width in header.widths]
    with pytest.warns(UserWarning, match="SH degree 4, of which degrees 0 to 3"):
        assert read(tmp_path, pack_spz(header, blocks)).sh.shape == (count, 16, 3)


@pytest.mark.parametrize("version", [3, 4])
def test_extensions_are_passed_over_and_other_axes_refused(tmp_path, scene, version):
    plain = encode_spz(scene, version=version)

    def extended(record):
        if version == 3:
            data = bytearray(gzip.decompress(plain) + record)
            data[14] |= 2
            return gzip.compress(bytes(data))
        data = bytearray(plain[:32] + record + plain[32:])
        data[14] |= 2
        struct.pack_into("<I", data, 16, 32 + len(record))
        return bytes(data)

    camera = struct.pack("<II3f", 0xADBE0002, 12, 0, 1, 2)
    equal(read(tmp_path, extended(camera)), read(tmp_path, plain))
    for axes, right in ((4, True), (6, True), (8, False)):  # right up back; right down front; a mirrored one
        data = extended(camera + struct.pack("<III", 0xADBE0003, 4, axes))
        if right:
            equal(read(tmp_path, data), read(tmp_path, plain))
        else:
            with pytest.raises(InputError, match="neither in SPZ's axes"):
                read(tmp_path, data)


def test_damage_is_named(tmp_path, scene):
    whole = encode_spz(scene, version=4)

    def changed(at, kind, value):
        data = bytearray(whole)
        struct.pack_into(kind, data, at, value)
        return bytes(data)

    cases = [
        (whole[:20], "cut short in its header"),
        (whole[:-3], "damaged"),
        (changed(15, "<B", 5), "a table of 5 streams"),
        (changed(16, "<I", 8), "streams at byte 8"),
        (changed(16, "<I", 4_000_000_000), "at byte 4000000000"),
        (changed(40, "<Q", 64), "declares 7 Gaussians and holds more"),
        (changed(8, "<I", 8), "declares 8 Gaussians and holds less"),
        (changed(8, "<I", 4_000_000_000), "declares 4000000000 Gaussians in"),  # never allocated
        (changed(32, "<Q", 10), "damaged"),
    ]
    for data, message in cases:
        with pytest.raises(InputError, match=message) as caught:
            read(tmp_path, data)
        assert "x.spz" in str(caught.value) and "\n" not in str(caught.value)
    rng = np.random.default_rng(0)
    for _ in range(150):  # whatever the bytes: a finite scene, or an InputError
        data = bytearray(whole)
        data[rng.integers(len(data))] = rng.integers(256)
        try:
            assert np.isfinite(read(tmp_path, bytes(data)).means).all()
        except InputError as error:
            assert "\n" not in str(error)


def test_without_zstandard_version_4_is_refused(tmp_path, scene, monkeypatch):
    data = encode_spz(scene, version=4)
    monkeypatch.setitem(sys.modules, "zstandard", None)
    for act in (lambda: read(tmp_path, data), lambda: write_spz(tmp_path / "y.spz", scene, version=4)):
        with pytest.raises(InputError, match=r"pip install 'rein3d-jax\[export\]'"):
            act()
    assert not (tmp_path / "y.spz").exists()
