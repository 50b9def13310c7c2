"""Files as cameras, stitchers and estimators write them: read as what they mean, or refused by what they are.

cases/ holds them small, re-made after public reports, of one synthetic room; its picture and exact distance are
pano.png and dist.exr. What would be large is written here.
"""

import struct
import zlib
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from experiments.reconstruct.inputs import InputConfig, told_panorama
from rein3d_jax.errors import InputError
from rein3d_jax.geometry.colour import srgb_from_linear
from rein3d_jax.io.pictures import photo
from rein3d_jax.io.pictures.decode import open_image
from rein3d_jax.io.pictures.distance import read_distance
from rein3d_jax.io.pictures.photo import read_photo, read_rgb

CASES = Path(__file__).with_name("cases")
ROWS = 128
JPEG = 2 / 255  # mean error of sRGB that JPEG leaves
# Mean difference of sRGB from the picture as it is; holes that were filled count, too.
PICTURES = {
    "cmyk_jpeg.jpg": JPEG,
    "exif_orientation_0.jpg": JPEG,
    "exif_orientation_1.jpg": JPEG,
    "form_webp.webp": JPEG,
    "form_wrong_suffix.jpg": 0,
    "icc_adobe_rgb.jpg": JPEG,
    "icc_display_p3.png": 0.001,
    "jpeg_gainmap.jpg": JPEG,
    "jpeg_progressive.jpg": JPEG,
    "png_palette.png": 0,
    "aspect_2048x1025.png": JPEG,
    "gpano_roll15.jpg": 3 / 255,  # levelled: interpolated twice
    "gpano_crop_rows.jpg": 4 / 255,  # its poles are filled from what is beside them
    "black_caps.png": 4 / 255,
    "black_nadir.png": JPEG,
    "png_rgba16.png": JPEG,
}
REFUSED = {
    "cubemap_strip.png": "cube map in a strip: convert it",
    "dual_fisheye_insp.insp": "two fisheye circles side by side: stitch",
    "exif_orientation_3.jpg": "stored rotated",
    "exif_orientation_6.jpg": "stored rotated",
    "form_avif.avif": "give a JPEG, PNG, TIFF, WebP, EXR or HDR",
    "stereo_top_bottom.png": "stereo pair .* upper half",
}
MAPS = {"d_exr_tiled_half.exr": 1, "d_half_size.npy": 1, "d_png16_rgb.png": 1, "d_structured3d.png": 1,
        "d_exr_blender_z.exr": 1, "d_mm_65535.png": 1, "d_2d3ds.png": 0.512}  # fmt: skip
REFUSED_MAPS = {
    "d_cm.exr": "no room is so large; set input.distance_unit",
    "d_disparity255.exr": "input.distance_kind = disparity",
    "d_matterport.png": "a floor 6 m below the camera: .* set input.distance_unit .*0.00025",
}


def taken(picture: str = "pano.png", distance: str | Path | None = None, **changes):
    """The panorama of a case's files, what was told, and the lean."""
    given = None if distance is None else str(CASES / distance)
    return told_panorama(InputConfig(str(CASES / picture), given, None, ROWS, **changes))


@pytest.fixture(scope="module")
def exact():
    return read_distance(CASES / "dist.exr")[0]


@pytest.mark.parametrize("name", PICTURES)
def test_a_picture_shows_the_room(name):
    panorama, _, _ = taken(name)
    found = np.abs(np.asarray(panorama.rgb) - read_rgb(CASES / "pano.png"))
    assert found.mean() <= PICTURES[name] + 1e-6


@pytest.mark.parametrize("name", ["black_caps.png", "black_nadir.png", "png_rgba16.png", "gpano_crop_rows.jpg"])
def test_what_a_picture_does_not_show_is_told_and_not_black(name):
    panorama, told, _ = taken(name)
    unseen = ~read_photo(CASES / name).seen
    assert unseen.any() and "takes the colours around" in told
    assert np.asarray(panorama.rgb)[unseen].max(axis=-1).min() > 0.1


def test_a_picture_is_opened_once(monkeypatch):
    """To open a progressive JPEG is to decode all of it."""
    opened = []
    monkeypatch.setattr(photo, "open_image", lambda path: opened.append(path.name) or open_image(path))
    taken("jpeg_progressive.jpg")
    assert opened == ["jpeg_progressive.jpg"]


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_panorama_is_refused_by_what_it_is(name):
    with pytest.raises(InputError, match=REFUSED[name]) as refused:
        taken(name)
    assert "\n" not in str(refused.value)


def test_the_pose_that_a_file_tells_is_believed_unless_it_is_ignored():
    _, _, lean = taken("gpano_roll15.jpg")
    assert lean.told and lean.roll == pytest.approx(15, abs=1e-3) and "as its file tells" in lean.sentence
    _, _, lean = taken("gpano_roll15.jpg", pose="ignore")
    assert not lean.told and lean.roll == pytest.approx(15, abs=1)  # by the picture's own lines: the sign agrees


@pytest.mark.parametrize("name", MAPS)
def test_a_map_is_the_rooms(name, exact, tmp_path):
    path = CASES / name
    if name == "d_half_size.npy":
        path = tmp_path / name
        np.save(path, exact[::2, ::2])
    panorama, _, _ = taken(distance=path)
    known = np.asarray(panorama.valid)
    ratio = (np.asarray(panorama.distance) / exact)[known]
    assert known.mean() > 0.85
    np.testing.assert_allclose(np.median(ratio), MAPS[name], rtol=2e-3)  # half floats; millimetres
    assert np.percentile(ratio, 99.5) < 1.2 * MAPS[name]  # no code for "unknown" among them


@pytest.mark.parametrize("name", REFUSED_MAPS)
def test_a_map_that_no_room_has_is_refused_with_the_key(name):
    with pytest.raises(InputError, match=REFUSED_MAPS[name]):
        taken(distance=name)


def test_the_unit_may_be_given(exact):
    panorama, _, _ = taken(distance="d_matterport.png", distance_unit=0.00025)
    np.testing.assert_allclose(panorama.distance, exact, atol=2e-4)  # half a unit, and float16 of the case's truth


@pytest.mark.parametrize("shape", [(1, 128, 256), (128, 256, 1), (1, 1, 128, 256)])
def test_axes_of_length_one_do_not_count(exact, tmp_path, shape):
    np.save(tmp_path / "map.npy", exact.reshape(shape))
    np.testing.assert_array_equal(read_distance(tmp_path / "map.npy")[0], exact)


@pytest.mark.parametrize("kind", [">f4", "<f8", "uint16", "f2"])
def test_numbers_of_any_kind_are_the_same_map(exact, tmp_path, kind):
    numbers = exact * 1000 if kind == "uint16" else exact
    np.save(tmp_path / "map.npy", numbers.round().astype(kind) if kind == "uint16" else numbers.astype(kind))
    np.testing.assert_allclose(read_distance(tmp_path / "map.npy")[0], exact, rtol=1e-3)


def test_depth_is_found_beside_other_arrays(exact, tmp_path):
    np.savez(tmp_path / "map.npz", depth=exact, mask=exact > 0, intrinsics=np.eye(3))
    np.testing.assert_array_equal(read_distance(tmp_path / "map.npz")[0], exact)


@pytest.mark.parametrize("suffix", [".pfm", ".tif"])
def test_float_maps_of_other_formats_stand_upright(exact, tmp_path, suffix):
    path = tmp_path / f"map{suffix}"
    if suffix == ".pfm":  # rows from the bottom, little-endian: Debevec's format
        path.write_bytes(b"Pf\n256 128\n-1.0\n" + exact[::-1].astype("<f4").tobytes())
    else:
        out = oiio.ImageOutput.create(str(path))
        assert (
            out.open(str(path), oiio.ImageSpec(256, 128, 1, "float"))
            and out.write_image(exact[..., None].copy())
            and out.close()
        )
    np.testing.assert_array_equal(read_distance(path)[0], exact)


@pytest.mark.parametrize("code", [np.inf, 1e10, 10.0])
def test_what_stands_for_nothing_is_unknown(exact, tmp_path, code):
    """The last is a far clip: a number that many pixels hold exactly, and none exceeds."""
    numbers = exact.copy()
    numbers[40:60, :64] = code
    np.save(tmp_path / "map.npy", numbers)
    _, valid = read_distance(tmp_path / "map.npy")
    np.testing.assert_array_equal(valid, numbers == exact)


def test_wide_pictures_are_averaged_while_they_are_read(tmp_path):
    rgb = np.random.default_rng(0).random((64, 128, 3)).astype(np.float32)
    wide = np.repeat(np.repeat(rgb, 72, axis=0), 72, axis=1)  # 9216 columns: two to one
    out = oiio.ImageOutput.create("x.png")
    path = tmp_path / "wide.png"
    assert out.open(str(path), oiio.ImageSpec(9216, 4608, 3, "uint8")) and out.write_image(wide) and out.close()
    found = read_rgb(path)
    assert found.shape == (2304, 4608, 3)
    np.testing.assert_allclose(found[18::36, 18::36], rgb, atol=0.5 / 255 + 1e-6)  # bytes


def test_linear_light_in_a_png_and_other_primaries_become_srgb(tmp_path):
    """gAMA 1, and Adobe's primaries in cHRM: what a library reads of them, against the picture as it is."""
    plain = (CASES / "pano.png").read_bytes()

    def named(*chunks: tuple[bytes, bytes]) -> np.ndarray:
        made = [struct.pack(">I", len(b)) + t + b + struct.pack(">I", zlib.crc32(t + b)) for t, b in chunks]
        (tmp_path / "x.png").write_bytes(plain[:33] + b"".join(made) + plain[33:])
        return read_rgb(tmp_path / "x.png")

    as_it_is = read_rgb(CASES / "pano.png")
    linear = named((b"gAMA", struct.pack(">I", 100000)))
    np.testing.assert_allclose(linear, srgb_from_linear(as_it_is), atol=1e-5)
    srgb = struct.pack(">8I", 31270, 32900, 64000, 33000, 30000, 60000, 15000, 6000)
    np.testing.assert_array_equal(named((b"gAMA", struct.pack(">I", 45455)), (b"cHRM", srgb)), as_it_is)
    adobe = struct.pack(">8I", 31270, 32900, 64000, 33000, 21000, 71000, 15000, 6000)
    wide = named((b"gAMA", struct.pack(">I", 45455)), (b"cHRM", adobe))
    grey = as_it_is.max(axis=-1) - as_it_is.min(axis=-1) < 0.004  # white stays white, colours grow stronger
    np.testing.assert_allclose(wide[grey], as_it_is[grey], atol=0.02)  # gamma 2.2 against sRGB's curve
    assert np.ptp(wide, axis=-1).mean() > 1.05 * np.ptp(as_it_is, axis=-1).mean()
