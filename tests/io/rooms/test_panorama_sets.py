"""Structured3D and a folder of one's own: which files belong together, their order, what they read as; every fault."""

import cv2
import numpy as np
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.io.pictures.distance import write_distance_exr
from rein3d_jax.io.pictures.image import write_rgb
from rein3d_jax.io.pictures.panorama import read_panorama
from rein3d_jax.io.rooms.panorama_sets import panorama_sets

SHAPE = (16, 32)
RNG = np.random.default_rng(0)
MILLIMETRES = RNG.integers(500, 9000, SHAPE).astype(np.uint16)
MILLIMETRES[3, 4] = 0
DISTANCE = MILLIMETRES.astype(np.float32) / 1000
PICTURE = RNG.uniform(0.2, 0.8, (*SHAPE, 3))


def write_room(root, scene="scene_00000", room="485142"):
    folder = root / scene / "2D_rendering" / room / "panorama" / "full"
    folder.mkdir(parents=True)
    rgba = np.dstack([PICTURE[..., ::-1] * 255, np.full(SHAPE, 255)]).round().astype(np.uint8)
    cv2.imwrite(str(folder / "rgb_rawlight.png"), rgba)
    cv2.imwrite(str(folder / "depth.png"), MILLIMETRES)


def test_structured3d_is_read_in_order(tmp_path):
    for scene, room in (("scene_00010", "7"), ("scene_00002", "9"), ("scene_00002", "12")):
        write_room(tmp_path, scene, room)
    found = panorama_sets(tmp_path)
    assert [files.name for files in found] == ["scene_00002/12", "scene_00002/9", "scene_00010/7"]
    assert panorama_sets(tmp_path / "scene_00010") == found[2:]
    panorama = read_panorama(found[0].rgb, distance=found[0].distance)
    np.testing.assert_allclose(panorama.distance, DISTANCE, rtol=1e-6)  # float32
    np.testing.assert_array_equal(panorama.valid, MILLIMETRES > 0)
    np.testing.assert_allclose(panorama.rgb, PICTURE, atol=0.5 / 255 + 1e-6)  # 8 bits


def write_folder(folder):
    write_rgb(folder / "b.png", PICTURE)
    write_distance_exr(folder / "b_distance.exr", DISTANCE)
    write_rgb(folder / "a.jpg", PICTURE)
    cv2.imwrite(str(folder / "a_distance.png"), MILLIMETRES)
    cv2.imwrite(str(folder / "c.hdr"), PICTURE.astype(np.float32))
    np.save(folder / "c_distance.npy", DISTANCE)


def test_a_folder_of_every_format(tmp_path):
    write_folder(tmp_path)
    found = panorama_sets(tmp_path)
    assert [files.name for files in found] == ["a", "b", "c"]
    for files in found:
        distance = read_panorama(files.rgb, distance=files.distance).distance
        np.testing.assert_allclose(distance, DISTANCE, rtol=1e-6)  # float32


def test_faults_of_a_folder(tmp_path):
    def refused(message):
        with pytest.raises(InputError, match=message):
            panorama_sets(tmp_path)

    refused("holds no panorama")
    write_folder(tmp_path)
    (tmp_path / "b_distance.exr").rename(tmp_path / "d_distance.exr")
    refused(r"b.png has no distance: put b_distance.exr")
    np.save(tmp_path / "b_distance.npy", DISTANCE)
    (tmp_path / "d_distance.exr").rename(tmp_path / "b_distance.exr")
    refused(r"b.png has 2 distance maps")
    (tmp_path / "b_distance.npy").unlink()
    write_rgb(tmp_path / "b.jpg", PICTURE)
    refused(r"is one of 2 pictures of that name")


def test_files_that_do_not_fit_each_other(tmp_path):
    write_folder(tmp_path)
    np.save(tmp_path / "c_distance.npy", DISTANCE[:8])
    with pytest.raises(InputError, match=r"c_distance.npy has 8 x 32 values"):
        read_panorama(panorama_sets(tmp_path)[2].rgb, distance=panorama_sets(tmp_path)[2].distance)
