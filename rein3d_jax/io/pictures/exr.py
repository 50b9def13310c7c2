"""EXR files of float32 channels: the same values give the same bytes. Panoramas go in as linear light."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from rein3d_jax.geometry.colour import linear_from_srgb
from rein3d_jax.io.files.atomic import atomic_path


def write_rgb_exr(path: str | Path, rgb: np.ndarray) -> None:
    """Writes a picture (h, w, 3), sRGB in [0, 1], as linear light, atomically. Raises InputError."""
    linear = linear_from_srgb(np.clip(np.asarray(rgb, np.float32), 0, 1))
    write_exr(path, dict(zip("RGB", np.moveaxis(linear, -1, 0), strict=True)))


def write_exr(path: str | Path, channels: Mapping[str, np.ndarray]) -> None:
    """Writes channels (h, w) by name, atomically. Raises InputError."""
    pixels = np.stack([np.asarray(channel, np.float32) for channel in channels.values()], axis=-1)
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], "float")
    spec.channelnames = tuple(channels)
    spec.attribute("compression", "zip")
    spec.attribute("DateTime", "1980:01:01 00:00:00")  # or the time of writing goes in
    with atomic_path(path) as temporary:
        out = oiio.ImageOutput.create("openexr")
        written = out.open(str(temporary), spec) and out.write_image(pixels) and out.close()
        if not (written and _holds(temporary, pixels)):
            raise OSError(out.geterror() or "incomplete, is the disk full?")


def _holds(path: Path, pixels: np.ndarray) -> bool:
    # OpenImageIO does not notice when the last bytes of a file find no room (measured with RLIMIT_FSIZE).
    image = oiio.ImageInput.open(str(path))
    found = None if image is None else image.read_image("float")
    return found is not None and np.array_equal(found, pixels, equal_nan=True)
