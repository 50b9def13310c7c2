"""Gaussians -> splats: what one camera needs to evaluate and order them.

Both cameras evaluate a splat at a pixel as alpha = exp(log_opacity - |axes (feature - mean)|^2 / 2), where

- a pinhole pixel's feature is its position (u, v) and `axes` whitens the EWA covariance (Zwicker 2001);
- an equirectangular pixel's feature is its unit ray in camera axes, and `axes` whitens the covariance on
  the tangent plane at the Gaussian's own direction, with a third row along that direction that makes the
  measure the chord between the two rays: it grows all the way to the antipode, where the tangent plane
  alone would show a ghost. Longitude and latitude enter by the filter's shape alone (a column is narrow at a
  pole), so poles and seam are points like any other.
"""

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.conventions import ALPHA_CUT, EQUIRECTANGULAR
from rein3d_jax.geometry.covariance import scaled_axes
from rein3d_jax.geometry.poses import invert
from rein3d_jax.geometry.safe import safe_norm
from rein3d_jax.geometry.spherical_harmonics import rgb_from_sh
from rein3d_jax.rasterize.config import RasterizeConfig
from rein3d_jax.rasterize.pixel_filter import filtered
from rein3d_jax.scene import Camera, Gaussians

# Beyond this angular size (radians, one sigma) a footprint is no longer an ellipse on the sphere; up to it,
# alpha at the antipode, exp(-2 / 0.5^2) = 3e-4, lies under the 1/255 cut. A larger Gaussian is culled, as
# one at the near plane is.
_MAX_ANGULAR_SIGMA = 0.5
_MAX_RADIAL_SIGMA = 0.3  # of the distance; see _curved


@struct.dataclass
class Splats:
    """Splats of one camera, n of them; k is 2 (pinhole) or 3 (equirectangular)."""

    mean: jax.Array  # (n, k) in the camera's pixel features
    axes: jax.Array  # (n, k, k) whitening rows
    log_opacity: jax.Array  # (n,)
    rgb: jax.Array  # (n, 3)
    distance: jax.Array  # (n,) metres along the ray; also the order of compositing
    visible: jax.Array  # (n,) bool
    support: jax.Array  # (n,) sigmas to the 1/255 cut
    box: jax.Array  # (n, 4) left, top, right, bottom in pixels; equirectangular left may be negative
    place: jax.Array  # (n, 3) azimuth, latitude and angular reach of the support in radians; (n, 0) for a pinhole


def _whitening(cov_xx, cov_xy, cov_yy, det):
    """The whitening U (n, 2, 2), upper triangular, with U^T U = covariance^-1."""
    row_x = jnp.sqrt(cov_yy / det)
    first = jnp.stack([row_x, -row_x * cov_xy / cov_yy], axis=-1)
    second = jnp.stack([jnp.zeros_like(row_x), jax.lax.rsqrt(cov_yy)], axis=-1)
    return jnp.stack([first, second], axis=-2)


def _pinhole(points, spread, camera, config):
    """Mean (n, 2), axes (n, 2, 2), log opacity factor, support extents per unit sigma (n, 2), in range."""
    z = points[:, 2]
    in_range = (z > config.near) & (z < config.far)
    safe_z = jnp.where(in_range, z, 1.0)
    x, y = points[:, 0] / safe_z, points[:, 1] / safe_z
    mean = jnp.stack([x, y], axis=-1) * camera.focal + camera.centre
    # Far off the frustum the affine approximation explodes: the slope is held at the edge + 0.3 tan (gsplat).
    margin = 0.15 * jnp.array([camera.width, camera.height]) / camera.focal
    low = -camera.centre / camera.focal - margin
    high = (jnp.array([camera.width, camera.height]) - camera.centre) / camera.focal + margin
    slope = jnp.clip(jnp.stack([x, y], axis=-1), low, high)
    rows = (spread[:, :2] - slope[..., None] * spread[:, 2:]) * (camera.focal[:, None] / safe_z[:, None, None])
    covariance, factor = filtered(rows, config.filter_variance, config=config)
    xx, _, yy, _ = covariance
    return mean, _whitening(*covariance), factor, jnp.sqrt(jnp.stack([xx, yy], axis=-1)), in_range


def _pixel_frame(direction, pitch):
    """Unit vectors (n, 2, 3) along a panorama's rows and columns at `direction` (n, 3), and a column's width there
    (n,) over a row's height, `pitch`: 1 at a pole itself, where rows have no direction."""
    x, _, z = jnp.moveaxis(direction, -1, 0)
    cos_latitude = safe_norm(jnp.stack([x, z], axis=-1))
    at_pole = cos_latitude < 1e-6
    x, z, norm = jnp.where(at_pole, 0.0, x), jnp.where(at_pole, 1.0, z), jnp.where(at_pole, 1.0, cos_latitude)
    along = jnp.stack([z / norm, jnp.zeros_like(x), -x / norm], axis=-1)
    return jnp.stack([along, jnp.cross(along, direction)], axis=-2), jnp.maximum(cos_latitude, 1 - cos_latitude / pitch)


def _curved(rows, radial):
    """Footprint (n, 2, 3) over the tangent plane, per unit distance, to second order in sigma / distance.

    Rays to a Gaussian's points have second moments C + 3 (C s^2 + 2 c c^T) - tr(C) C - 2 C^2, C = rows rows^T,
    c = rows radial, s = |radial|: what lies nearer looks wider, and the sphere bends away. What is drawn (the chord's
    Gaussian) has Q - tr(Q) Q / 2, so Q = C + 3 (C s^2 + 2 c c^T) - tr(C) C / 2 - 2 C^2, here as M rows N with
    M = 1 - tr(C) / 4 - C, written (1 + tr(C) / 4 + C)^-1 to stay positive, and N = (1 + 3 s^2 / 2) (1 + 3 r r^T).
    At sigma / distance 0.3 the error of moments falls from 13 % to under 5 % (`python -m benchmarks poles`).
    """
    # The series is for Gaussians that keep clear of the camera.
    radial = radial * (_MAX_RADIAL_SIGMA / jnp.maximum(safe_norm(radial, keepdims=True), _MAX_RADIAL_SIGMA))
    rows = rows + 3.0 * jnp.sum(rows * radial[:, None], axis=-1, keepdims=True) * radial[:, None]
    rows = rows * (1.0 + 1.5 * jnp.sum(radial**2, axis=-1))[:, None, None]
    xx, xy, yy = (jnp.sum(rows[:, i] * rows[:, j], axis=-1) for i, j in ((0, 0), (0, 1), (1, 1)))
    own = 1.0 + (xx + yy) / 4.0
    first, second = own + xx, own + yy
    inverse = jnp.stack([jnp.stack([second, -xy], -1), jnp.stack([-xy, first], -1)], -2)
    return jnp.einsum("nij,njk->nik", inverse, rows, precision="highest") / (first * second - xy * xy)[:, None, None]


def _equirectangular(points, spread, distance, camera, config):
    """As `_pinhole`, with features in unit rays; the extents are one isotropic angle (n, 1)."""
    in_range = (distance > config.near) & (distance < config.far)
    safe_distance = jnp.where(in_range, distance, 1.0)
    direction = jnp.where(in_range[:, None], points, jnp.array([0.0, 0.0, 1.0])) / safe_distance[:, None]
    pitch = jnp.pi / camera.height
    frame, width = _pixel_frame(direction, pitch)
    rows = jnp.einsum("nij,njk->nik", frame, spread, precision="highest") / safe_distance[:, None, None]
    radial = jnp.einsum("ni,nij->nj", direction, spread, precision="highest") / safe_distance[:, None]
    rows = _curved(rows, radial)
    # A pixel is as wide as its column is there: in units of it the filter is round.
    rows = jnp.stack([rows[:, 0] / width[:, None], rows[:, 1]], axis=1)
    (xx, xy, yy, det), factor = filtered(rows, config.filter_variance * pitch**2, config=config)
    xx, xy, det = xx * width**2, xy * width, det * width**2
    axes = jnp.einsum("nij,njk->nik", _whitening(xx, xy, yy, det), frame, precision="highest")
    sigma = jnp.sqrt((xx + yy) / 2 + jnp.sqrt(((xx - yy) / 2) ** 2 + xy**2 + 1e-30))
    axes = jnp.concatenate([axes, (direction / sigma[:, None])[:, None]], axis=1)
    return direction, axes, factor, sigma[:, None], in_range & (sigma < _MAX_ANGULAR_SIGMA)


def _sphere_place(direction, reach):
    """Azimuth, latitude and, of a chord `reach` (n,), the angle: (n, 3) radians."""
    azimuth = jnp.arctan2(direction[:, 0], direction[:, 2])
    latitude = jnp.arctan2(-direction[:, 1], jnp.hypot(direction[:, 0], direction[:, 2]))  # exact at a pole too
    angle = 2 * jnp.arcsin(jnp.minimum(reach / 2, 1.0))  # a chord is 2 sin(angle / 2)
    return jnp.stack([azimuth, latitude, angle], axis=-1)


def _sphere_box(place, camera):
    """Pixel box (n, 4) of the cap of `_sphere_place`; the whole row where it holds a pole."""
    azimuth, latitude, angle = jnp.moveaxis(place, -1, 0)
    reach = jnp.sin(angle) / jnp.maximum(jnp.cos(latitude), 1e-12)  # sine of the cap's half width in azimuth
    over_pole = jnp.abs(latitude) + angle >= jnp.pi / 2
    half = jnp.where(over_pole, jnp.pi, jnp.arcsin(jnp.minimum(reach, 1.0)))
    u, du = (azimuth / (2 * jnp.pi) + 0.5) * camera.width, half / (2 * jnp.pi) * camera.width
    v, dv = (0.5 - latitude / jnp.pi) * camera.height, angle / jnp.pi * camera.height
    return jnp.stack([u - du, v - dv, u + du, v + dv], axis=-1)


def project(
    gaussians: Gaussians, camera: Camera, *, config: RasterizeConfig, means2d_offset: jax.Array | None = None
) -> Splats:
    """The splats of `camera`, of Gaussians in the world.

    Culled (visible = False): dead slots, non-finite parameters, centres out of [near, far], opacity under
    the 1/255 cut, support off the image, and on the sphere sizes over _MAX_ANGULAR_SIGMA.

    `means2d_offset` (n, 2) pixels, zeros, is added to the projected means: its gradient is the means2d gradient that
    densification reads (3DGS, Sec. 5.2). On the sphere a pixel is a row's pitch on the tangent plane.
    """
    count = gaussians.means.shape[0]
    assert gaussians.means.shape == (count, 3), gaussians.means.shape
    assert gaussians.quats.shape == (count, 4), gaussians.quats.shape
    camera_from_world = invert(camera.world_from_camera)
    rotation, translation = camera_from_world[:3, :3], camera_from_world[:3, 3]
    usable = gaussians.alive & _finite(gaussians)
    clean = jax.tree.map(lambda x: jnp.where(usable.reshape(-1, *[1] * (x.ndim - 1)), x, 0), gaussians)
    points = jnp.einsum("ij,nj->ni", rotation, clean.means, precision="highest") + translation
    distance = safe_norm(points)
    # exp of a clipped log: a scale of 1e3 m squared still fits float32, and so does 1e-8 m.
    spread = scaled_axes(jnp.clip(clean.log_scales, -18.5, 7.0), clean.quats)
    spread = jnp.einsum("ij,njk->nik", rotation, spread, precision="highest")
    if camera.model == EQUIRECTANGULAR:
        mean, axes, factor, extent, in_range = _equirectangular(points, spread, distance, camera, config)
    else:
        mean, axes, factor, extent, in_range = _pinhole(points, spread, camera, config)
    log_opacity = jax.nn.log_sigmoid(clean.opacity_logits) + factor
    support = jnp.sqrt(2.0 * jnp.maximum(jax.lax.stop_gradient(log_opacity) - jnp.log(ALPHA_CUT), 0.0))
    reach = support[:, None] * jax.lax.stop_gradient(extent)
    if camera.model == EQUIRECTANGULAR:
        place = _sphere_place(jax.lax.stop_gradient(mean), reach[:, 0])
        box = _sphere_box(place, camera)
        on_image = jnp.ones(count, bool)
    else:
        low, high = mean - reach, mean + reach
        place = jnp.zeros((count, 0))
        box = jax.lax.stop_gradient(jnp.concatenate([low, high], axis=-1))
        on_image = (box[:, 2] > 0) & (box[:, 3] > 0) & (box[:, 0] < camera.width) & (box[:, 1] < camera.height)
    visible = usable & in_range & on_image & (log_opacity > jnp.log(ALPHA_CUT))
    centre = camera.world_from_camera[:3, 3]
    direction = (clean.means - centre) / jnp.maximum(distance, 1e-12)[:, None]
    if means2d_offset is not None:
        mean = mean + _feature_offset(means2d_offset, points, distance, camera)
    rgb = rgb_from_sh(clean.sh, direction)
    return Splats(mean, axes, log_opacity, rgb, distance, visible, support, box, place)


def _feature_offset(pixels, points, distance, camera):
    """Offsets (n, 2) in pixels as offsets (n, k) of the camera's pixel features."""
    if camera.model != EQUIRECTANGULAR:
        return pixels
    direction = jax.lax.stop_gradient(points / jnp.maximum(distance, 1e-12)[:, None])
    pitch = jnp.pi / camera.height
    return jnp.einsum("ni,nij->nj", pixels, _pixel_frame(direction, pitch)[0]) * pitch


def _finite(gaussians: Gaussians) -> jax.Array:
    """Whether all parameters of a slot are finite: (n,)."""
    rows = [gaussians.means, gaussians.log_scales, gaussians.quats, gaussians.opacity_logits[:, None]]
    flat = jnp.concatenate([*rows, gaussians.sh.reshape(gaussians.sh.shape[0], -1)], axis=-1)
    return jnp.all(jnp.isfinite(flat), axis=-1)
