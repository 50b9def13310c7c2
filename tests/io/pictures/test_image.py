"""Pictures round trip, resizing keeps means and the seam, and every bad picture is refused by name."""

import resource
import struct
import zlib

import cv2
import numpy as np
import OpenImageIO as oiio
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.io.pictures.image import encode_jpeg, encode_png, resize_panorama, to_uint8, write_rgb
from rein3d_jax.io.pictures.photo import read_rgb

RNG = np.random.default_rng(0)
RGB = (RNG.integers(0, 256, (16, 32, 3)) / 255).astype(np.float32)
SMOOTH = cv2.resize(RGB[:4, :8], (64, 32), interpolation=cv2.INTER_LINEAR)
EXACT = 1e-7  # k / 255 in float32


def write_oiio(path, pixels, names, kind="float", **attributes):
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], kind)
    spec.channelnames = names
    for name, value in attributes.items():
        spec.attribute(name, value)
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), spec) and out.write_image(pixels) and out.close(), out.geterror()


def png_chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def wide_png():
    header = struct.pack(">IIBBBBB", 40000, 20000, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + png_chunk(b"IHDR", header) + png_chunk(b"IDAT", zlib.compress(bytes(99)))


def wide_jpeg(progressive):
    small = cv2.imencode(".jpg", np.zeros((16, 32, 3), np.uint8), [cv2.IMWRITE_JPEG_PROGRESSIVE, progressive])[1]
    data = bytearray(small.tobytes())
    at = data.index(b"\xff\xc2" if progressive else b"\xff\xc0") + 5
    data[at : at + 4] = struct.pack(">HH", 20000, 40000)
    return bytes(data)


WIDE = {
    "wide.png": wide_png(),
    "wide.jpg": wide_jpeg(0),
    "wide_progressive.jpg": wide_jpeg(1),
    "wide.hdr": b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 20000 +X 40000\n",
}


def test_png_round_trip_is_exact(tmp_path):
    write_rgb(tmp_path / "x.png", RGB)
    got = read_rgb(tmp_path / "x.png")
    assert got.dtype == np.float32 and got.shape == (16, 32, 3)
    np.testing.assert_allclose(got, RGB, atol=EXACT)


def test_jpeg_round_trip(tmp_path):
    write_rgb(tmp_path / "x.jpg", SMOOTH)
    # Quality 92 with 4:2:0 chroma on smooth colours.
    assert np.abs(read_rgb(tmp_path / "x.jpg") - SMOOTH).mean() < 0.02


def test_encoders_agree_with_an_independent_decoder():
    decoded = cv2.imdecode(np.frombuffer(encode_png(RGB), np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
    np.testing.assert_array_equal(decoded, to_uint8(RGB))
    assert encode_jpeg(RGB, 30) == encode_jpeg(RGB, 30) and len(encode_jpeg(RGB, 30)) < len(encode_jpeg(RGB, 95))


def test_grey_alpha_and_16_bits(tmp_path):
    grey = RNG.integers(0, 65536, (16, 32)).astype(np.uint16)
    cv2.imwrite(str(tmp_path / "grey16.png"), grey)
    expected = np.repeat(grey[..., None] / 65535, 3, axis=-1)
    np.testing.assert_allclose(read_rgb(tmp_path / "grey16.png"), expected, atol=EXACT)
    cv2.imwrite(str(tmp_path / "grey.jpg"), np.full((16, 32), 100, np.uint8))
    np.testing.assert_allclose(read_rgb(tmp_path / "grey.jpg"), 100 / 255, atol=EXACT)
    rgba = RNG.integers(0, 256, (16, 32, 4)).astype(np.uint8)  # colours are as stored, where they are there to be seen
    cv2.imwrite(str(tmp_path / "rgba.png"), rgba)
    opaque = (rgba[..., 3:] >= 128) * rgba[..., 2::-1]
    np.testing.assert_allclose(read_rgb(tmp_path / "rgba.png"), opaque / 255, atol=EXACT)


@pytest.mark.parametrize("suffix", [".exr", ".hdr"])
def test_linear_formats_are_tone_mapped(tmp_path, suffix):
    light = np.full((16, 32, 3), 123.0, np.float32)
    write_oiio(tmp_path / f"x{suffix}", light, ("R", "G", "B"))
    # A flat picture is exposed to 0.18, filmic(0.18) = 0.267, in sRGB 0.554; HDR keeps 8 bits of mantissa.
    np.testing.assert_allclose(read_rgb(tmp_path / f"x{suffix}"), 0.5538, atol=3e-3)


def test_exr_with_wild_values_and_alpha_is_finite(tmp_path):
    light = np.exp(RNG.standard_normal((16, 32, 4))).astype(np.float32)
    light[0, 0], light[1, 1], light[2, 2] = np.nan, np.inf, -1
    write_oiio(tmp_path / "x.exr", light, ("R", "G", "B", "A"))
    rgb = read_rgb(tmp_path / "x.exr")
    assert rgb.shape == (16, 32, 3) and np.isfinite(rgb).all()
    assert rgb[0, 0].max() == 0 and rgb[1, 1].min() > 0.9 and rgb[2, 2].max() == 0


@pytest.mark.parametrize(
    ("width", "height", "message"),
    [
        (1000, 600, "1000x600, not 2:1; a panorama must be twice as wide as high"),
        (2, 1, "2x1; .* 16 rows"),
        (1, 2, "1x2"),
    ],
)
def test_wrong_sizes_are_refused_by_name(tmp_path, width, height, message):
    cv2.imwrite(str(tmp_path / "pano.png"), np.zeros((height, width, 3), np.uint8))
    with pytest.raises(InputError, match=f"pano.png is {message}"):
        read_rgb(tmp_path / "pano.png")


@pytest.mark.parametrize("name", WIDE)
@pytest.mark.parametrize("padding", [0, 30_000_000])  # with it the file is large enough to be believed
def test_40000_columns_are_refused_before_allocation(tmp_path, name, padding):
    (tmp_path / name).write_bytes(WIDE[name] + bytes(padding))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(InputError, match=f"{name} cannot be opened .*40000x20000.*at most 20000 columns"):
        read_rgb(tmp_path / name)
    # The pixels would take 2.4 GB. KiB; the room is for OpenImageIO itself and the padding.
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000


def test_not_a_picture(tmp_path):
    (tmp_path / "text.jpg").write_text("hello")
    (tmp_path / "empty.exr").write_bytes(b"")
    write_oiio(tmp_path / "x.tga", RGB, ("R", "G", "B"))
    for name in ("text.jpg", "empty.exr", "x.tga"):
        with pytest.raises(InputError, match=rf"{name} .*give a JPEG, PNG, TIFF, WebP, EXR or HDR"):
            read_rgb(tmp_path / name)


def test_missing_file_and_folder(tmp_path):
    for path in (tmp_path / "none.jpg", tmp_path, tmp_path / "made_up.null"):
        with pytest.raises(InputError, match=f"{path.name} cannot be read"):
            read_rgb(path)


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".exr"])
def test_truncated_pictures(tmp_path, suffix):
    path = tmp_path / f"cut{suffix}"
    write_oiio(path, RNG.random((64, 128, 3), np.float32), ("R", "G", "B"), "float" if suffix == ".exr" else "uint8")
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(InputError, match=rf"cut{suffix} is damaged"):
        read_rgb(path)


@pytest.mark.parametrize("at", [40, 0.6])  # of the header, of the pixels
def test_a_damaged_png_has_one_line_and_libpng_none(tmp_path, at, capfd):
    path = tmp_path / "room.png"
    whole = bytearray(encode_png(np.random.default_rng(0).integers(0, 256, (32, 64, 3), np.uint8)))
    whole[at if at > 1 else int(at * len(whole))] ^= 255
    path.write_bytes(whole)
    with pytest.raises(InputError, match=r"room\.png"):
        read_rgb(path)
    assert capfd.readouterr().err == ""


def test_cropped_turned_and_colourless_pictures(tmp_path):
    write_oiio(tmp_path / "turned.jpg", RGB, ("R", "G", "B"), "uint8", Orientation=3)
    write_oiio(tmp_path / "layers.exr", RGB, ("a.U", "b.V", "c.W"))
    spec = oiio.ImageSpec(32, 16, 3, "float")
    spec.full_width, spec.full_height = 64, 32
    out = oiio.ImageOutput.create("openexr")
    assert out.open(str(tmp_path / "cropped.exr"), spec) and out.write_image(RGB) and out.close()
    for name, message in [("turned.jpg", "save it upright"), ("layers.exr", "A.U, B.V"), ("cropped.exr", "uncropped")]:
        with pytest.raises(InputError, match=rf"{name} .*{message}"):
            read_rgb(tmp_path / name)


def test_resize_to_the_same_height_is_no_op():
    distance, valid = RGB[..., 0], RGB[..., 0] > 0.5
    got = resize_panorama(RGB, distance, valid, 16)
    assert got[0] is RGB and got[1] is distance and got[2] is valid


@pytest.mark.parametrize("height", [4, 5, 8, 11])
def test_shrinking_keeps_the_mean_and_mixes_no_distance(height):
    valid = RGB[..., 1] > 0.3
    rgb, distance, picked_valid = resize_panorama(RGB, RGB[..., 0], valid, height)
    assert rgb.shape == (height, 2 * height, 3) and distance.shape == picked_valid.shape == (height, 2 * height)
    np.testing.assert_allclose(rgb.mean((0, 1)), RGB.mean((0, 1)), atol=1e-5)  # float32 sums of 512 values
    stored = set(zip(RGB[..., 0].ravel(), valid.ravel(), strict=True))
    assert set(zip(distance.ravel(), picked_valid.ravel(), strict=True)) <= stored  # picked together, never mixed


@pytest.mark.parametrize("height", [8, 32])
def test_resize_commutes_with_yaw(height):
    """Seam-safe: a roll by a whole number of pixels before equals the roll after."""
    roll = {8: 2, 32: 1}[height]
    rolled = resize_panorama(np.roll(RGB, roll, axis=1), np.roll(RGB[..., 0], roll, axis=1), None, height)
    straight = resize_panorama(RGB, RGB[..., 0], None, height)
    for a, b in zip(rolled[:2], straight[:2], strict=True):
        np.testing.assert_allclose(a, np.roll(b, roll * height // 16, axis=1), atol=1e-6)  # float32 weights
    assert rolled[2] is None


def test_enlarging_a_smooth_sphere_follows_it():
    """Colours that are the directions themselves: bilinear error of a unit-curvature function, (pi / 16)^2 / 8."""

    def directions(h):
        latitude = (0.5 - (np.arange(h) + 0.5) / h)[:, None] * np.pi
        azimuth = ((np.arange(2 * h) + 0.5) / (2 * h) - 0.5)[None] * 2 * np.pi
        parts = (
            np.cos(azimuth) * np.cos(latitude),
            -np.sin(azimuth) * np.cos(latitude),
            np.sin(latitude) + 0 * azimuth,
        )
        return np.stack(parts, axis=-1).astype(np.float32)

    got = resize_panorama(directions(16), None, None, 40)[0]
    np.testing.assert_allclose(got, directions(40), atol=2 * (np.pi / 16) ** 2 / 8)  # twice: both axes


def test_write_rgb_bad_targets(tmp_path, file_size_limit):
    with pytest.raises(InputError, match=r"x.webp .*end it in .png or .jpg"):
        write_rgb(tmp_path / "x.webp", RGB)
    write_rgb(tmp_path / "x.png", RGB)
    earlier = (tmp_path / "x.png").read_bytes()
    with file_size_limit(100), pytest.raises(InputError, match=r"x.png cannot be written .*free some space"):
        write_rgb(tmp_path / "x.png", RGB)
    assert (tmp_path / "x.png").read_bytes() == earlier
