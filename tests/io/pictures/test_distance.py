"""Distance round trips by every format; the unknown is masked; planar z, millimetres and wrong sizes are refused."""

import os
import struct
import zipfile

import cv2
import numpy as np
import OpenImageIO as oiio
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.io.pictures.distance import read_distance, write_distance_exr

RNG = np.random.default_rng(0)
SHAPE = (16, 32)
DISTANCE = (1 + 5 * RNG.random(SHAPE)).astype(np.float32)


def write_exr(path, layers, kind="float"):
    names = tuple(layers)
    spec = oiio.ImageSpec(SHAPE[1], SHAPE[0], len(names), kind)
    spec.channelnames = names
    out = oiio.ImageOutput.create("openexr")
    assert out.open(str(path), spec) and out.write_image(np.stack(list(layers.values()), -1)) and out.close()


def refused(path, message, shape=SHAPE):
    with pytest.raises(InputError, match=message) as caught:
        read_distance(path, shape)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_exr_round_trip_is_exact_and_repeatable(tmp_path):
    write_distance_exr(tmp_path / "a.exr", DISTANCE)
    write_distance_exr(tmp_path / "b.exr", DISTANCE)
    distance, valid = read_distance(tmp_path / "a.exr", SHAPE)
    np.testing.assert_array_equal(distance, DISTANCE)
    assert distance.dtype == np.float32 and valid.dtype == bool and valid.all()
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()
    assert b"1980:01:01" in (tmp_path / "a.exr").read_bytes()  # not the time of writing


@pytest.mark.parametrize("name", ["Y", "R", "depth", "Distance", "ViewLayer.Depth.V", "anything"])
def test_exr_channel_names(tmp_path, name):
    write_exr(tmp_path / "x.exr", {name: DISTANCE})
    np.testing.assert_array_equal(read_distance(tmp_path / "x.exr", SHAPE)[0], DISTANCE)


def test_exr_picks_distance_among_channels_and_takes_grey_stored_as_colour(tmp_path):
    write_exr(tmp_path / "many.exr", {"A": 0 * DISTANCE, "R": DISTANCE + 1, "room.distance": DISTANCE})
    holes = np.where(DISTANCE > 3, DISTANCE, np.float32(np.nan))
    write_exr(tmp_path / "grey.exr", {"R": holes, "G": holes, "B": holes, "A": 0 * DISTANCE + 1})
    np.testing.assert_array_equal(read_distance(tmp_path / "many.exr", SHAPE)[0], DISTANCE)
    np.testing.assert_array_equal(read_distance(tmp_path / "grey.exr", SHAPE)[1], DISTANCE > 3)


def test_png_is_millimetres(tmp_path):
    millimetres = RNG.integers(0, 65536, SHAPE).astype(np.uint16)
    cv2.imwrite(str(tmp_path / "x.png"), millimetres)
    distance, valid = read_distance(tmp_path / "x.png", SHAPE)
    np.testing.assert_allclose(distance, millimetres / 1000, rtol=1e-7)  # float32 rounding
    np.testing.assert_array_equal(valid, millimetres > 0)


@pytest.mark.parametrize("kind", ["<f2", "<f4", ">f4", "<f8"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_npy_types_and_orders(tmp_path, kind, order):
    np.save(tmp_path / "x.npy", np.asarray(DISTANCE.astype(kind), order=order))
    np.testing.assert_array_equal(read_distance(tmp_path / "x.npy", SHAPE)[0], DISTANCE.astype(kind).astype("f4"))


def test_npz_single_array_or_the_key_distance(tmp_path):
    np.savez_compressed(tmp_path / "one.npz", DISTANCE)
    np.savez(tmp_path / "key.npz", distance=DISTANCE, Z=DISTANCE / 2, other=np.arange(3))
    for name in ("one.npz", "key.npz"):
        np.testing.assert_array_equal(read_distance(tmp_path / name, SHAPE)[0], DISTANCE)
    np.savez(tmp_path / "two.npz", a=DISTANCE, b=DISTANCE)
    refused(tmp_path / "two.npz", "arrays a, b: name the one to use distance")


def test_unknown_is_a_mask_and_finite(tmp_path):
    wild = DISTANCE.astype(np.float64)
    wild[0, :6] = [0, -1, np.nan, np.inf, -np.inf, 1e300]  # 1e300 is inf as float32
    np.save(tmp_path / "x.npy", wild)
    distance, valid = read_distance(tmp_path / "x.npy", SHAPE)
    assert not valid[0, :6].any() and valid.sum() == valid.size - 6
    assert np.isfinite(distance).all() and not distance[~valid].any()


@pytest.mark.parametrize("nothing", [0.0, -1.0, np.nan, np.inf])
def test_all_unknown_is_refused(tmp_path, nothing):
    write_distance_exr(tmp_path / "x.exr", np.full(SHAPE, nothing))
    refused(tmp_path / "x.exr", "holds no distance")


def test_millimetres_are_refused(tmp_path):
    np.save(tmp_path / "x.npy", DISTANCE * 1000)
    refused(tmp_path / "x.npy", "looks like millimetres; divide it by 1000")


@pytest.mark.parametrize("name", ["Z", "depth_z", "planar", "zdepth"])
def test_planar_z_is_never_taken_silently(tmp_path, name):
    write_exr(tmp_path / "x.exr", {name: DISTANCE})
    np.savez(tmp_path / "x.npz", **{name: DISTANCE})
    for path in (tmp_path / "x.exr", tmp_path / "x.npz"):
        refused(path, "says planar z, not distance: set input.distance_kind = z")
        np.testing.assert_array_equal(read_distance(path, metres=False)[0], DISTANCE)  # taken as it was said


def test_planar_z_beside_other_channels(tmp_path):
    write_exr(tmp_path / "x.exr", {"U": DISTANCE, "Z": DISTANCE})
    refused(tmp_path / "x.exr", "'Z', which says planar z")
    write_exr(tmp_path / "rgbz.exr", {"R": DISTANCE, "G": DISTANCE / 2, "B": DISTANCE, "Z": DISTANCE})
    refused(tmp_path / "rgbz.exr", "colour picture")
    write_exr(tmp_path / "layer.exr", {"room.R": DISTANCE, "room.G": DISTANCE, "room.B": DISTANCE / 2})
    refused(tmp_path / "layer.exr", "colour picture")


def test_wrong_size_names_both(tmp_path):
    write_distance_exr(tmp_path / "x.exr", DISTANCE)
    np.save(tmp_path / "x.npy", DISTANCE)
    for path in (tmp_path / "x.exr", tmp_path / "x.npy"):
        refused(path, "16 x 32 values .* panorama 256 x 512", shape=(256, 512))
        np.testing.assert_array_equal(read_distance(path)[0], DISTANCE)  # any size of 2:1
    np.save(tmp_path / "square.npy", DISTANCE[:, :16])
    refused(tmp_path / "square.npy", "16 x 16 values .* twice as many columns as rows", shape=None)


def test_wrong_kinds(tmp_path):
    cv2.imwrite(str(tmp_path / "8.png"), np.ones(SHAPE, np.uint8))
    cv2.imwrite(str(tmp_path / "x.jpg"), np.ones(SHAPE, np.uint8))
    write_exr(tmp_path / "ids.exr", {"Y": DISTANCE.astype(np.uint32)}, "uint")
    for name in ("8.png", "x.jpg", "ids.exr"):
        refused(tmp_path / name, "no distance map: give a float EXR, TIFF or PFM, a 16-bit grey PNG")
    cv2.imwrite(str(tmp_path / "rgb16.png"), np.arange(3 * 16 * 32).reshape(16, 32, 3).astype(np.uint16))
    refused(tmp_path / "rgb16.png", "is a colour picture")
    np.save(tmp_path / "bool.npy", np.ones(SHAPE, bool))
    refused(tmp_path / "bool.npy", "holds bool values: save the distance as float metres")


def test_missing_damaged_and_pickled(tmp_path):
    refused(tmp_path / "none.npy", "cannot be read")
    refused(tmp_path / "none.exr", "cannot be read")
    np.save(tmp_path / "objects.npy", np.full(SHAPE, None), allow_pickle=True)
    refused(tmp_path / "objects.npy", "never unpickled")
    np.save(tmp_path / "cut.npy", DISTANCE)
    os.truncate(tmp_path / "cut.npy", 1000)
    refused(tmp_path / "cut.npy", "more than it holds")
    (tmp_path / "text.npz").write_text("hello")
    refused(tmp_path / "text.npz", "damaged or no NPY or NPZ")
    with zipfile.ZipFile(tmp_path / "empty.npz", "w"):
        pass
    refused(tmp_path / "empty.npz", r"\(none\)")


def test_a_bomb_is_refused_by_its_header(tmp_path):
    """A header that declares 40,000 x 20,000 doubles (6.4 GB) in a small file."""
    np.save(tmp_path / "x.npy", np.zeros((10, 10)))
    data = (tmp_path / "x.npy").read_bytes().replace(b"(10, 10), }        ", b"(20000, 40000), }  ")
    assert b"40000" in data
    (tmp_path / "x.npy").write_bytes(data)
    refused(tmp_path / "x.npy", "more than it holds", shape=(20000, 40000))


def test_40000_columns_are_refused(tmp_path):
    path = tmp_path / "wide.exr"
    write_distance_exr(path, DISTANCE)
    small, wide = (struct.pack("<4i", 0, 0, w - 1, h - 1) for w, h in ((32, 16), (40000, 20000)))
    data = path.read_bytes().replace(small, wide)
    for padding in (0, 30_000_000):  # with it the file is large enough to be believed
        path.write_bytes(data + bytes(padding))
        refused(path, "40000x20000.*at most 20000 columns", shape=(20000, 40000))


def test_disk_full_keeps_the_earlier_file(tmp_path, file_size_limit):
    write_distance_exr(tmp_path / "x.exr", DISTANCE)
    earlier = (tmp_path / "x.exr").read_bytes()
    with file_size_limit(500), pytest.raises(InputError, match=r"x.exr cannot be written .*disk full"):
        write_distance_exr(tmp_path / "x.exr", DISTANCE + 1)
    assert (tmp_path / "x.exr").read_bytes() == earlier and os.listdir(tmp_path) == ["x.exr"]
    with pytest.raises(InputError, match="cannot be written"):
        write_distance_exr(tmp_path / "x.exr" / "below_a_file.exr", DISTANCE)
