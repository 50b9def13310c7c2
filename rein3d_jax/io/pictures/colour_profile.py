"""Colours as a file means them, made sRGB: its ICC profile, or the primaries and the gamma that it names."""

import io
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from PIL import Image, ImageCms

from rein3d_jax.errors import InputError
from rein3d_jax.geometry.colour import srgb_from_linear

_REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)  # x, y of red, green, blue, white
_ALIKE = 1e-3  # of chromaticities, as PNG and EXR round them
_SRGB_GAMMA = 2.2, 0.05  # which files name that mean sRGB; how near


def srgb_by_profile(path: Path, spec: oiio.ImageSpec, rgb: np.ndarray) -> np.ndarray:
    """The picture (h, w, 3) in [0, 1] of a file that does not hold linear light, in sRGB: by its ICC profile, where it
    has one of RGB (8 bits a channel remain), else by PNG's gAMA and cHRM. Raises InputError for a damaged profile."""
    profile = spec.getattribute("ICCProfile")
    if profile is not None:
        return _by_icc(path, bytes(profile), rgb)
    gamma, named = _named(path)
    primaries = _REC709 if named is None else (*named[2:], *named[:2])
    power = 1 / gamma if gamma else _SRGB_GAMMA[0]
    if abs(power - _SRGB_GAMMA[0]) < _SRGB_GAMMA[1] and np.allclose(primaries, _REC709, atol=_ALIKE):
        return rgb
    return srgb_from_linear(np.clip(rec709_light(rgb**power, primaries), 0, 1)).astype(np.float32)


def _named(path: Path) -> tuple[float | None, tuple[float, ...] | None]:
    """PNG's gAMA, and cHRM: x and y of white, red, green, blue. None where the file says nothing that can be read."""
    try:
        with Image.open(path, formats=["PNG"]) as header:
            return header.info.get("gamma"), header.info.get("chromaticity")
    except (OSError, ValueError, SyntaxError):  # no PNG, or one that OpenImageIO reads all the same
        return None, None


def rec709_light(light: np.ndarray, primaries: tuple[float, ...]) -> np.ndarray:
    """Linear light (..., 3) of `primaries` (x and y of red, green, blue, white), in those of sRGB; its white stays
    white."""
    if np.allclose(primaries, _REC709, atol=_ALIKE):
        return light
    matrix = np.linalg.solve(_xyz_from_rgb(_REC709), _xyz_from_rgb(primaries))
    return np.maximum(light @ (matrix / matrix.sum(axis=1, keepdims=True)).T.astype(np.float32), 0)


def _xyz_from_rgb(primaries: tuple[float, ...]) -> np.ndarray:
    x, y = np.reshape(primaries, (4, 2)).T
    xyz = np.stack([x / y, np.ones(4), (1 - x - y) / y])
    return xyz[:, :3] * np.linalg.solve(xyz[:, :3], xyz[:, 3])


def _by_icc(path: Path, profile: bytes, rgb: np.ndarray) -> np.ndarray:
    try:
        found = ImageCms.ImageCmsProfile(io.BytesIO(profile))
        if found.profile.xcolor_space.strip() != "RGB" or (found.profile.profile_description or "").startswith("sRGB"):
            return rgb
        picture = Image.fromarray((rgb * 255 + 0.5).astype(np.uint8))
        converted = ImageCms.profileToProfile(picture, found, ImageCms.createProfile("sRGB"))
    except (ImageCms.PyCMSError, OSError) as error:
        raise InputError(f"{path} has a damaged colour profile ({error}): save it in sRGB") from error
    return np.asarray(converted, np.float32) / 255
