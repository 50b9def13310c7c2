"""Linear light to a displayable picture: exposure by log-average luminance, a filmic curve, the sRGB transfer."""

import numpy as np

from rein3d_jax.geometry.colour import srgb_from_linear

KEY = 0.18  # the exposed log-average luminance: middle grey (Reinhard et al. 2002, eq. 1-2)
_REC709_LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
_SATURATED = 16.0  # the curve passes 1 near 7; beyond this its squares only risk overflow
_DARKEST = 1e-4  # of the median: what sensor noise and black frames may weigh in the logarithm


def tone_map(linear: np.ndarray) -> np.ndarray:
    """sRGB float32 in [0, 1] of a panorama (h, w, 3) of linear Rec. 709 light in any unit.

    NaN and negative light count as 0, infinite light as the brightest finite value. The result does not change
    when the input is multiplied by a constant or rotated about the vertical.
    """
    linear = _finite_light(linear)
    with np.errstate(over="ignore"):  # inf is cut to _SATURATED
        exposed = np.minimum(linear * exposure(linear), np.float32(_SATURATED))
    return srgb_from_linear(np.clip(filmic(exposed), 0, 1))


def _finite_light(linear: np.ndarray) -> np.ndarray:
    """Light of any shape, made finite and not negative, float32."""
    linear = np.asarray(linear, np.float32)
    brightest = np.max(linear, initial=0.0, where=np.isfinite(linear))
    return np.maximum(np.nan_to_num(linear, nan=0.0, posinf=brightest, neginf=0.0), 0)


def exposure(linear: np.ndarray) -> np.float32:
    """The factor that brings the log-average luminance of a panorama (h, w, 3) to KEY, each row weighted by
    cos(latitude), its area on the sphere; 1 for a black picture."""
    luminance = linear @ _REC709_LUMINANCE
    if not luminance.any():
        return np.float32(1)
    latitude = (0.5 - (np.arange(len(luminance)) + 0.5) / len(luminance)) * np.pi
    floor = _DARKEST * np.median(luminance[luminance > 0])
    rows = np.log(np.maximum(luminance, floor)).mean(axis=1, dtype=np.float64)
    return np.float32(KEY / np.exp(np.average(rows, weights=np.cos(latitude))))


def filmic(x: np.ndarray) -> np.ndarray:
    """Filmic curve x (2.51 x + 0.03) / (x (2.43 x + 0.59) + 0.14), by channel: Narkowicz 2015, "ACES filmic tone
    mapping curve". Bright saturated lights go towards white, as on film."""
    return x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)
