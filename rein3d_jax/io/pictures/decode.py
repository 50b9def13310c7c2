"""The one door to OpenImageIO's readers: the header first, pixels when it has been judged."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.input_file import require_file

MAX_COLUMNS = 20000
# OpenImageIO reads many more, a made-up ".null" among them; "pnm" is PFM, too.
_FORMATS = ("jpeg", "png", "openexr", "hdr", "tiff", "webp", "bmp", "pnm")
_BAND = 64  # rows that are reduced at a time
_CREDIT = 200  # characters of each
_MEND = f"give a JPEG, PNG, TIFF, WebP, EXR or HDR file of at most {MAX_COLUMNS} columns"


@contextmanager
def open_image(path: Path) -> Iterator[oiio.ImageInput]:
    """The opened file, its header read and its pixels not: `.spec()` says sizes, channels and types.

    Raises InputError if it is missing, is no picture, is larger than MAX_COLUMNS, or is cropped or rotated.
    """
    require_file(path)
    # A progressive JPEG is decoded whole when it is opened, so the limit must hold inside OpenImageIO.
    oiio.attribute("limits:resolution", MAX_COLUMNS)
    as_stored = oiio.ImageSpec()
    as_stored.attribute("oiio:UnassociatedAlpha", 1)  # colours not multiplied by alpha
    as_stored.attribute("pnm:pfmflip", 1)  # PFM begins at the bottom
    image = None
    try:
        with _silent_libpng():
            image = oiio.ImageInput.open(str(path), as_stored)
        if image is None:
            raise InputError(f"{path} cannot be opened as a picture ({_first_line(oiio.geterror())}): {_MEND}")
        if image.format_name() not in _FORMATS:
            raise InputError(f"{path} is a {image.format_name()} file: {_MEND}")
        _check_whole_and_upright(path, image.spec())
        yield image
    except UnicodeDecodeError as error:  # from any text of a damaged header, and errors that quote it
        raise InputError(f"{path} is damaged (its header is no text): {_MEND}") from error
    finally:
        if image is not None:
            image.close()


def read_pixels(path: Path, image: oiio.ImageInput, kind: str) -> np.ndarray:
    """All pixels (h, w, channels) as `kind` ("float", "uint16"). Raises InputError if the file is damaged."""
    with _silent_libpng():
        pixels = image.read_image(kind)
    error = image.geterror()
    if pixels is None or error:
        raise InputError(f"{path} is damaged or cut short ({_first_line(error)}): copy or export it again")
    return pixels


def read_reduced(path: Path, image: oiio.ImageInput, columns: int) -> np.ndarray:
    """Pixels (h / k, w / k, channels) as float, each the mean of k x k of the file's, k the least that leaves no more
    than `columns`; rows and columns left over are left out. Raises InputError as `read_pixels` does."""
    spec = image.spec()
    k = -(-spec.width // columns)
    if k == 1 or spec.tile_width:
        return read_pixels(path, image, "float")
    wide, rows = spec.width // k, spec.height // k
    found = np.empty((rows, wide, spec.nchannels), np.float32)
    for begin in range(0, rows, _BAND):
        end = min(begin + _BAND, rows)
        with _silent_libpng():
            band = image.read_scanlines(begin * k, end * k, 0, 0, spec.nchannels, "float")
        if band is None:
            raise InputError(f"{path} is damaged or cut short ({_first_line(image.geterror())}): export it again")
        band = band.reshape(end - begin, k, spec.width, -1)[:, :, : wide * k]
        found[begin:end] = band.reshape(end - begin, k, wide, k, -1).mean(axis=(1, 3))
    return found


def read_credit(path: Path) -> str:
    """Author and licence of the picture as its header has them, in one line; "" where it has none. Raises
    InputError as `open_image` does."""
    with open_image(path) as image:
        said = (image.spec().get_string_attribute(name) for name in ("Artist", "Copyright"))
        return "; ".join(" ".join(text.split())[:_CREDIT] for text in said if text.strip())


@contextmanager
def _silent_libpng() -> Iterator[None]:
    """While it lasts nothing is written to the process's stderr: libpng writes what OpenImageIO reports as well."""
    try:
        kept = os.dup(2)
    except OSError:  # a process without one
        yield
        return
    with open(os.devnull, "wb") as nowhere:
        os.dup2(nowhere.fileno(), 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)


def _check_whole_and_upright(path: Path, spec: oiio.ImageSpec) -> None:
    window = (spec.x, spec.y, spec.width, spec.height)
    if window != (spec.full_x, spec.full_y, spec.full_width, spec.full_height):
        whole = f"{spec.full_width}x{spec.full_height}"
        raise InputError(f"{path} stores {spec.width}x{spec.height} of a {whole} picture: save it uncropped")
    if (orientation := spec.get_int_attribute("Orientation", 1)) not in (0, 1):  # 0: some stitchers', for "not said"
        raise InputError(f"{path} is stored rotated (EXIF orientation {orientation}): save it upright")


def _first_line(error: str) -> str:
    return " ".join(error.strip().partition("\n")[0].split()) or "no reason given"
