"""Fly-throughs as MP4 (H.264, 4:2:0, BT.709 limited range) that any player shows in the right colours."""

import io
import itertools
from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from av.video.reformatter import ColorPrimaries, ColorRange, Colorspace, ColorTrc, Interpolation

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import write_bytes
from rein3d_jax.io.pictures.image import to_uint8

_CRF = "16"  # visually lossless: a panning photograph, 1024 x 512, comes back at 43 dB in 100 kB a second
_SCALING = Interpolation.AREA | Interpolation.ACCURATE_RND | Interpolation.FULL_CHR_H_INP | Interpolation.BITEXACT


def write_mp4(path: str | Path, frames: Iterable[np.ndarray], fps: float) -> None:
    """Writes frames (h, w, 3) sRGB in [0, 1], all of one size, to `path`, atomically. An odd size grows by
    repeating its last row or column (4:2:0 needs even sizes). The same frames give the same bytes on any number of
    cores. Raises InputError if there are no frames or the file cannot be written."""
    pictures = (_even(to_uint8(frame)) for frame in frames)
    first = next(pictures, None)
    if first is None:
        raise InputError(f"{path} would have no frames: render at least one")
    # Encoded in memory: files here are small, and a full disk is then found by write_bytes as for any other.
    buffer = io.BytesIO()
    with av.open(buffer, "w", format="mp4", options={"fflags": "+bitexact"}) as container:
        stream = _add_stream(container, first.shape, fps)
        for picture in itertools.chain([first], pictures):
            container.mux(stream.encode(_yuv(picture)))
        container.mux(stream.encode())
    write_bytes(path, buffer.getvalue())


def _add_stream(container: av.container.OutputContainer, shape: tuple[int, ...], fps: float) -> av.VideoStream:
    # One thread: x264's choices depend on how many it has. No macroblock tree: its AVX-512 code reads memory that
    # nothing wrote, and one small film in three came out different (tests/io; x264 core 165).
    options = {"crf": _CRF, "preset": "medium", "threads": "1", "x264-params": "mbtree=0"}
    stream = container.add_stream("libx264", rate=Fraction(fps).limit_denominator(1001), options=options)
    context = stream.codec_context
    context.height, context.width, context.pix_fmt = shape[0], shape[1], "yuv420p"
    context.colorspace, context.color_range = Colorspace.ITU709, ColorRange.MPEG
    context.color_primaries, context.color_trc = ColorPrimaries.BT709, ColorTrc.BT709
    return stream


def _yuv(picture: np.ndarray) -> av.VideoFrame:
    return av.VideoFrame.from_ndarray(picture, "rgb24").reformat(
        format="yuv420p",
        dst_colorspace=Colorspace.ITU709,
        dst_color_range=ColorRange.MPEG,
        dst_color_trc=ColorTrc.BT709,
        dst_color_primaries=ColorPrimaries.BT709,
        interpolation=_SCALING,
        threads=1,
    )


def _even(picture: np.ndarray) -> np.ndarray:
    h, w, _ = picture.shape
    return np.pad(picture, ((0, h % 2), (0, w % 2), (0, 0)), mode="edge")
