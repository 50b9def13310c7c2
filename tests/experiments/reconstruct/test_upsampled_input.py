"""A small picture is doubled before all else while the height allows; what was photographed stays in it."""

import numpy as np
import pytest

from experiments.reconstruct.inputs import InputConfig, input_panorama
from rein3d_jax.geometry.pyramid import blocks
from rein3d_jax.io.pictures.distance import read_distance
from rein3d_jax.io.pictures.photo import read_rgb


@pytest.mark.parametrize(
    ("upsample", "height", "picture", "rows"),
    [
        ("none", 512, 256, 256),
        ("learned", 512, 256, 512),
        ("learned", 512, 128, 512),
        ("bicubic", 500 // 32 * 32, 256, 256),  # 480 rows are less than twice as many
        ("learned", 512, 512, 512),
        ("learned", 512, 2048, 512),
        ("learned", 512, 300, 288),  # its own rows are a multiple of 32
    ],
)
def test_rows_are_doubled_while_the_height_allows(upsample, height, picture, rows):
    assert InputConfig(height=height, upsample=upsample).rows(picture) == rows


def test_the_picture_and_its_distance_are_those_of_twice_the_rows(rooms, tmp_path):
    room = rooms / "room2"
    distance = np.kron(read_distance(room / "input_distance.exr")[0], np.ones((2, 2), np.float32))
    np.save(tmp_path / "map.npy", distance)
    files = (str(room / "input.png"), str(tmp_path / "map.npy"), None)
    found = input_panorama(InputConfig(*files, 128, upsample="bicubic", level=False))
    assert found.rgb.shape == (128, 256, 3)
    np.testing.assert_allclose(blocks(found.rgb).mean(axis=2), read_rgb(room / "input.png"), atol=1e-6)  # float32 means
    np.testing.assert_array_equal(found.distance, distance)  # the map has the rows already: nothing of it is lost
