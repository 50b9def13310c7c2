"""Row 2 of the list of failures: needles beside a view that reach into it. Where a splat's middle lies far off, the
affine approximation of perspective explodes, so that renderers hold its slope at the view's edge, which turns it.

A line's picture is a line: the true direction of a needle's is that from its middle to its end."""

import jax.numpy as jnp
import numpy as np

from benchmarks.stability.regime import OURS, SMALL, Figure, Figures, Regime
from rein3d_jax.geometry.poses import equirectangular_camera, pinhole_camera, upright
from rein3d_jax.geometry.resample import perspective_crop
from rein3d_jax.geometry.rotations import quats_from_matrix
from rein3d_jax.rasterize import RasterizeConfig, render
from rein3d_jax.scene import Gaussians

_FOV, _SIDE = 70.0, 128  # degrees, pixels
_DISTANCE, _LENGTH, _WIDTH = 2.0, 0.8, 0.004  # metres; sigmas
_TURNED = Figure("turned", "degrees that a needle is turned", SMALL, 2.0)
_NOWHERE = 90.0  # degrees: where none of it is shown


def _beside(degrees: float, seed: int) -> dict[str, Figures]:
    """A needle whose middle is so many degrees beyond the view's edge, and which rises or falls into it."""
    angle, climb = np.radians(_FOV / 2 + degrees), np.radians(np.random.default_rng([seed, 3]).uniform(10, 30))
    middle = _DISTANCE * np.array([np.cos(angle), -np.sin(angle), 0.1])
    inward = np.array([np.sin(angle), np.cos(angle), 0.0])  # across the ray to it
    axis = np.cos(climb) * inward + np.sin(climb) * np.array([0.0, 0.0, 1.0])
    needle, pose = _needle(middle, axis), upright(jnp.zeros(3), 0.0)
    view = pinhole_camera(pose, _SIDE, np.radians(_FOV))
    frame, _ = render(needle, view, config=RasterizeConfig())
    around, _ = render(needle, equirectangular_camera(pose, 512), config=RasterizeConfig())
    cut = perspective_crop(around.alpha[..., None], pose, view)[..., 0]
    shown = {OURS: frame.alpha, "ours, from a panorama": cut}
    true = _slope(middle, axis)
    return {name: {"turned": _off(np.asarray(alpha), true)} for name, alpha in shown.items()}


def _needle(middle: np.ndarray, axis: np.ndarray) -> Gaussians:
    across = np.cross(axis, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across)
    axes = np.stack([axis, across, np.cross(axis, across)], axis=-1)
    return Gaussians(
        means=jnp.asarray(middle, jnp.float32)[None], log_scales=jnp.log(jnp.array([[_LENGTH, _WIDTH, _WIDTH]])),
        quats=quats_from_matrix(jnp.asarray(axes, jnp.float32))[None], opacity_logits=jnp.full(1, 5.0),
        sh=jnp.zeros((1, 1, 3)), alive=jnp.ones(1, bool),
    )  # fmt: skip


def _slope(middle: np.ndarray, axis: np.ndarray) -> float:
    """Radians of its picture's direction, u right and v down: world axes, the camera looks along +X."""
    ends = [middle + step * axis for step in (0.0, 0.5)]
    (u, v), (other_u, other_v) = ((-y / x, -z / x) for x, y, z in ends)
    return float(np.arctan2(other_v - v, other_u - u))


def _off(alpha: np.ndarray, true: float) -> float:
    """Degrees between the main direction of what is shown and the true one."""
    if alpha.sum() < 1:
        return _NOWHERE
    v, u = np.indices(alpha.shape)
    offsets = np.stack([u - (u * alpha).sum() / alpha.sum(), v - (v * alpha).sum() / alpha.sum()])
    _, vectors = np.linalg.eigh(np.einsum("ihw,jhw,hw->ij", offsets, offsets, alpha))
    found = np.arctan2(vectors[1, -1], vectors[0, -1])
    apart = abs(found - true) % np.pi
    return float(np.degrees(min(apart, np.pi - apart)))


REGIMES = (
    Regime("needles beside the view", "fans at the picture's edge", "degrees beyond the edge", (0, 2, 5, 10, 15, 20), 0,
           _TURNED, _beside, rows="2"),
)  # fmt: skip
