"""Whatever bytes a file holds, a reader returns or raises an InputError of one line that names the file."""

import random

import cv2
import numpy as np
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.checkpoint import load, save
from rein3d_jax.io.files.npy import read_headers
from rein3d_jax.io.pictures.distance import read_distance, write_distance_exr
from rein3d_jax.io.pictures.image import encode_jpeg, encode_png
from rein3d_jax.io.pictures.photo import read_rgb
from rein3d_jax.io.splats.ply import read_ply, write_ply
from rein3d_jax.scene import Gaussians

SHAPE = (16, 32)
DISTANCE = np.linspace(1, 5, 512, dtype=np.float32).reshape(SHAPE)
RGB = np.stack([DISTANCE / 5] * 3, -1)
SCENE = Gaussians(*(np.ones((3, *tail), np.float32) for tail in ((3,), (3,), (4,), (), (4, 3))), np.ones(3, bool))


def read_metres(path):
    return read_distance(path, SHAPE)


def read_tree(path):
    return load(path, {"a": DISTANCE})


FORMATS = {
    "a.ply": (lambda path: write_ply(path, SCENE), read_ply),
    "a.npz": (lambda path: save(path, {"a": DISTANCE}), read_tree),
    "d.npz": (lambda path: np.savez_compressed(path, DISTANCE), read_metres),
    "d.npy": (lambda path: np.save(path, DISTANCE), read_metres),
    "d.exr": (lambda path: write_distance_exr(path, DISTANCE), read_metres),
    "d.png": (lambda path: cv2.imwrite(str(path), (1000 * DISTANCE).astype(np.uint16)), read_metres),
    "a.png": (lambda path: path.write_bytes(encode_png(RGB)), read_rgb),
    "a.jpg": (lambda path: path.write_bytes(encode_jpeg(RGB)), read_rgb),
}


def damage(data, rng):
    data = bytearray(data)
    for _ in range(rng.choice([1, 1, 4])):
        data[rng.randrange(min(len(data), rng.choice([200, 2000])))] = rng.randrange(256)
    return data if rng.random() < 0.7 else data[: rng.randrange(len(data))]


def read_or_refuse(read, path):
    try:
        read(path)
    except InputError as error:
        assert str(path) in str(error) and len(str(error).splitlines()) == 1


@pytest.mark.filterwarnings("ignore")  # NumPy warns of values and headers that only damage brings forth
@pytest.mark.parametrize("name", FORMATS)
def test_damaged_bytes(tmp_path, name):
    write, read = FORMATS[name]
    write(tmp_path / name)
    read(tmp_path / name)
    whole, rng = (tmp_path / name).read_bytes(), random.Random(name)
    for _ in range(60):
        (tmp_path / name).write_bytes(damage(whole, rng))
        read_or_refuse(read, tmp_path / name)


def test_headers_that_are_no_text(tmp_path):
    """Found by the test above with other seeds: OpenImageIO and NumPy raise errors of their own on these."""
    write_distance_exr(tmp_path / "x.exr", DISTANCE)
    data = (tmp_path / "x.exr").read_bytes()
    (tmp_path / "x.exr").write_bytes(data.replace(b"chlist", b"chl\xa6st"))
    with pytest.raises(InputError, match=r"x.exr is damaged"):
        read_metres(tmp_path / "x.exr")
    np.save(tmp_path / "x.npy", DISTANCE)
    data = (tmp_path / "x.npy").read_bytes()
    (tmp_path / "x.npy").write_bytes(data.replace(b"), }", b"(, }"))
    with pytest.raises(InputError, match=r"x.npy is damaged"):
        read_headers(tmp_path / "x.npy")
