"""EXR: linear light comes back as the sRGB that went in; channels keep their names; the same values, the same bytes."""

import numpy as np
import OpenImageIO as oiio

from rein3d_jax.geometry.colour import linear_from_srgb, srgb_from_linear
from rein3d_jax.io.pictures.exr import write_exr, write_rgb_exr


def read(path):
    image = oiio.ImageInput.open(str(path))
    return image.spec().channelnames, image.read_image("float")


def test_a_picture_is_stored_as_linear_light(tmp_path):
    rgb = np.random.default_rng(0).random((8, 16, 3)).astype(np.float32)
    rgb[0, 0] = [0, 1, 2]  # what is above white is cut
    write_rgb_exr(tmp_path / "a.exr", rgb)
    names, linear = read(tmp_path / "a.exr")
    assert tuple(names) == ("R", "G", "B") and linear.max() == 1
    np.testing.assert_allclose(srgb_from_linear(linear), np.minimum(rgb, 1), atol=1e-6)  # float32 powers
    write_rgb_exr(tmp_path / "b.exr", rgb)
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()


def test_the_transfer_is_undone_everywhere():
    srgb = np.linspace(0, 1, 10_001)
    # The standard's two pieces meet to 1e-8, and its constants are rounded.
    np.testing.assert_allclose(srgb_from_linear(linear_from_srgb(srgb)), srgb, atol=1e-6)
    np.testing.assert_allclose(linear_from_srgb(0.5), 0.21404114, atol=1e-8)  # IEC 61966-2-1


def test_channels_keep_their_names_and_values(tmp_path):
    values = np.array([[0.0, -1.5, 1e30], [np.inf, np.nan, 3.0]], np.float32)
    write_exr(tmp_path / "a.exr", {"Y": values})
    names, found = read(tmp_path / "a.exr")
    assert tuple(names) == ("Y",)
    np.testing.assert_array_equal(found[..., 0], values)
