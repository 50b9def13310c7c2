"""A film's colours come back right, its size is even, its bytes repeat."""

import av
import cv2
import numpy as np
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.io.pictures.video import write_mp4

RNG = np.random.default_rng(0)
PATCH = 16
# 6 x 8 patches of flat colour: the corners of the cube among them.
COLOURS = np.concatenate([np.stack(np.meshgrid(*[[0, 1]] * 3), -1).reshape(8, 3), RNG.random((40, 3))]).reshape(6, 8, 3)
FRAME = COLOURS.repeat(PATCH, 0).repeat(PATCH, 1).astype(np.float32)


def decode(path):
    with av.open(str(path)) as container:
        return list(container.decode(video=0)), container.streams.video[0].average_rate


def rgb_from_bt709(frame):
    """The standard's own equations on the decoded planes (ITU-R BT.709, limited range), not FFmpeg's converter."""
    h, w = frame.height, frame.width
    planes = frame.to_ndarray().astype(np.float64)
    chroma = planes[h:].reshape(2, h // 2, w // 2).repeat(2, 1).repeat(2, 2)
    y, (cb, cr) = (planes[:h] - 16) / 219, (chroma - 128) / 224
    return np.stack([y + 1.5748 * cr, y - 0.18732 * cb - 0.46812 * cr, y + 1.8556 * cb], axis=-1)


def test_colours_come_back(tmp_path):
    write_mp4(tmp_path / "x.mp4", [FRAME] * 5, 24)
    frames, rate = decode(tmp_path / "x.mp4")
    assert len(frames) == 5 and rate == 24
    for frame in frames:
        inside = rgb_from_bt709(frame).reshape(6, PATCH, 8, PATCH, 3)[:, 4:-4, :, 4:-4].mean((1, 3))
        # Patch middles, away from 4:2:0 bleeding. Rounding of Y, Cb, Cr alone gives up to 1.5 / 255; BT.601 taken
        # for 709, or full range for limited, gives more than 15 / 255.
        np.testing.assert_allclose(inside, COLOURS, atol=4 / 255)


def test_stream_says_bt709_limited(tmp_path):
    write_mp4(tmp_path / "x.mp4", [FRAME], 10)
    with av.open(str(tmp_path / "x.mp4")) as container:
        context = container.streams.video[0].codec_context
        assert (context.colorspace, context.color_primaries, context.color_trc, context.color_range) == (1, 1, 1, 1)
        assert context.name == "h264" and context.pix_fmt == "yuv420p"


def test_same_frames_same_bytes_from_a_generator(tmp_path):
    frames = [np.roll(FRAME, 3 * i, axis=1) for i in range(12)]
    write_mp4(tmp_path / "a.mp4", iter(frames), 24)
    write_mp4(tmp_path / "b.mp4", frames, 24)
    assert (tmp_path / "a.mp4").read_bytes() == (tmp_path / "b.mp4").read_bytes()


def test_same_bytes_whatever_memory_held_before(tmp_path):
    """Frames straight from FFmpeg's converter gave up to 8 different films in 200 turns of this."""
    rng = np.random.default_rng(1)
    picture = cv2.GaussianBlur(rng.random((150, 160, 3)).astype(np.float32), (0, 0), 3)
    picture = (picture - picture.min()) / np.ptp(picture)
    frames, films = [picture[2 * i : 2 * i + 48, 3 * i : 3 * i + 64] for i in range(24)], set()
    for _ in range(12):
        junk = [np.full(rng.integers(100, 200_000), rng.integers(256), np.uint8) for _ in range(50)]
        del junk
        write_mp4(tmp_path / "x.mp4", frames, 15)
        films.add((tmp_path / "x.mp4").read_bytes())
    assert len(films) == 1


def test_odd_sizes_grow_by_their_edge(tmp_path):
    write_mp4(tmp_path / "x.mp4", [FRAME[:-1, :-1]] * 2, 29.97)
    frames, rate = decode(tmp_path / "x.mp4")
    assert (frames[0].height, frames[0].width) == FRAME.shape[:2] and abs(rate - 29.97) < 1e-3
    # FRAME's last row and column repeat their neighbours, so the padded film is the film of FRAME.
    write_mp4(tmp_path / "whole.mp4", [FRAME] * 2, 29.97)
    assert (tmp_path / "x.mp4").read_bytes() == (tmp_path / "whole.mp4").read_bytes()


def test_no_frames_bad_target_and_full_disk(tmp_path, file_size_limit):
    path = tmp_path / "x.mp4"
    with pytest.raises(InputError, match=r"x.mp4 would have no frames"):
        write_mp4(path, [], 24)
    assert not path.exists()
    write_mp4(path, [FRAME], 24)
    earlier = path.read_bytes()
    with file_size_limit(500), pytest.raises(InputError, match=r"x.mp4 cannot be written .*free some space"):
        write_mp4(path, [FRAME] * 3, 24)
    with pytest.raises(InputError, match="cannot be written"):
        write_mp4(path / "below_a_file.mp4", [FRAME], 24)
    assert path.read_bytes() == earlier
