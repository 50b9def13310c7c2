"""Panorama + distance -> Gaussians: one splat for each equirectangular pixel (paper Sec. 3.1).

Centre by back-projection, colour from the pixel, size from the pixel's footprint on the sphere at its distance, high
opacity. The paper's splats are balls, and gaps open between them where a surface that was seen at a slant is seen from
elsewhere. Ours lie along the surface, stretched so that from where they were lifted they look as round as balls.
Everything scales with the distance; nothing here is in absolute metres.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp

from rein3d_jax.errors import InputError
from rein3d_jax.geometry.resample import pad_sphere
from rein3d_jax.geometry.rotations import quats_from_matrix
from rein3d_jax.geometry.safe import safe_norm
from rein3d_jax.geometry.sphere import latitudes, rays_of_pose, world_from_camera_axes
from rein3d_jax.geometry.spherical_harmonics import sh_from_rgb
from rein3d_jax.lift.edges import snap_edges
from rein3d_jax.lift.surface import slopes, surface_axes
from rein3d_jax.scene import Gaussians, Panorama


@dataclass(frozen=True)
class LiftConfig:
    capacity: int = 0  # slots of the scene's buffer; 0 gives twice the lifted pixels, room for what exploring adds
    stride: int = 1  # lift every stride-th pixel of every stride-th row
    opacity: float = 0.99
    footprint: float = 0.85  # sigma over half the diagonal of a pixel's footprint; see footprint_sigma
    steepest: float = 6.0  # tangent of incidence up to which a splat is stretched along its surface; 0: never
    thickness: float = 0.3  # of a splat across its surface, over its width
    # At most share x pixels become Gaussians, the fewer the smoother the picture and the flatter the surface; 1: all.
    share: float = 1.0
    largest: int = 16  # with a share below 1: most pixels along a side that one Gaussian stands for, a power of 2
    flatness: float = 0.003  # there, relative: how far a surface may stray from the plane of its Gaussian
    leaf_step: float = 0.05  # there, relative: steps of inverse distance that no Gaussian spans
    snap_edges: bool = True
    # See edges.snap_edges. At 256 x 512, 24 links hold a step blurred by a Gaussian of 3 pixels (4 % of the pixels
    # off both surfaces before, none after; with 16 links still 4 %). The price on exact, furnished rooms of that
    # size: 1.2 % of the pixels move by more than 2 % (faces seen nearly edge-on); 1.0 % with 16 links.
    edge_ramp: int = 24
    edge_step: float = 0.1
    edge_slope: float = 0.01


def footprint_sigma(distance: jax.Array, row_pitch: float, latitude: jax.Array, footprint: float) -> jax.Array:
    """sigma = footprint * half the diagonal of a footprint `distance * pitch` high and cos(latitude) times as wide.

    Half the diagonal is how far the splat must reach (its pixel's corner), so it follows the shrinking of a row but
    not to 0, where rows stay a pitch apart. Least alpha at pixel corners within 15 degrees of a floor's pole, seen
    from the origin, and least alpha of that cap from 0.5 m away (64 x 128, floor 1.6 m below, sigma 0.6 of a
    pitch on the horizon): half diagonal 0.997 and 0.953; arithmetic mean of the sides 0.975, 0.924; geometric mean
    0.043, 0.244 (ring-shaped holes); smaller side 0, 0; larger side 1, 0.997, but it does not shrink at all.
    `footprint` 0.85 is sigma = 0.6 pitch at the horizon: alpha 0.95 at the corners, 74 % contrast left at a period
    of 4 pixels. sigma 0.5: 0.84 and 85 % (the background shows through); 0.7: 0.986 and 61 %.
    """
    return footprint * distance * row_pitch * 0.5 * jnp.sqrt(1 + jnp.cos(latitude) ** 2)


def _box_colour(rgb: jax.Array, stride: int) -> jax.Array:
    """Mean of (h, w, 3) over `stride` pixels centred ON each pixel (the ends of an even window weigh half)."""
    reach = stride // 2
    ends = (0.5 if stride % 2 == 0 else 1.0) / stride
    weights = [ends if abs(k) == reach and reach else 1 / stride for k in range(-reach, reach + 1)]
    padded = pad_sphere(rgb, reach)
    rows = sum(weight * padded[k : k + rgb.shape[0]] for k, weight in enumerate(weights))
    return sum(weight * rows[:, k : k + rgb.shape[1]] for k, weight in enumerate(weights))


def _lift(
    panorama: Panorama, world_from_camera: jax.Array, select: jax.Array, *, config: LiftConfig = LiftConfig()
) -> Gaussians:
    """Gaussians of capacity (h / stride) * (w / stride), row by row, spherical harmonics of degree 0.

    `world_from_camera` (4, 4) is the panorama's pose in OpenCV axes; the input's is rigid(world_from_camera_axes(), 0).
    `select` (h, w) bool says which pixels become Gaussians; of these, the ones whose distance is known come alive.
    Raises InputError where the stride does not divide the height. Source: paper Sec. 3.1.
    """
    height, width = panorama.distance.shape
    stride = config.stride
    assert panorama.rgb.shape == (height, width, 3), panorama.rgb.shape
    assert select.shape == panorama.valid.shape == (height, width), (select.shape, panorama.valid.shape)
    if stride < 1 or height % stride or width % stride:
        raise InputError(f"lift.stride {stride} does not divide {width}x{height} pixels; set a divisor of {height}")
    known = panorama.valid & (panorama.distance > 0)
    distance = panorama.distance
    if config.snap_edges:
        distance = snap_edges(distance, known, ramp=config.edge_ramp, step=config.edge_step, slope=config.edge_slope)
    # One pixel gives ray AND distance, so that its centre stays exactly on the surface at any stride.
    chosen = (slice(stride // 2, None, stride), slice(stride // 2, None, stride))
    alive = (select & known)[chosen].ravel()
    distance_of_all, distance = distance, jnp.where(alive, distance[chosen].ravel(), 1.0)
    slope = slopes(distance_of_all, known)
    slope *= jnp.minimum(1.0, config.steepest / jnp.maximum(safe_norm(slope, keepdims=True), 1e-6))
    axes, tangent = (x[chosen].reshape(-1, *x.shape[2:]) for x in surface_axes(slope, height, width))
    rays = rays_of_pose(world_from_camera, height, width)[chosen].reshape(-1, 3)
    latitude = jnp.repeat(latitudes(height)[chosen[0]], width // stride)
    sigma = footprint_sigma(distance, stride * jnp.pi / height, latitude, config.footprint)
    along, across = jnp.sqrt(1 + tangent**2), jnp.ones_like(tangent)
    stretch = jnp.stack([along, across, config.thickness * across], axis=-1)
    turn = jnp.matmul(world_from_camera[:3, :3], world_from_camera_axes().T, precision=jax.lax.Precision.HIGHEST)
    count = distance.shape[0]
    return Gaussians(
        means=rays * distance[:, None] + world_from_camera[:3, 3],
        log_scales=jnp.log(sigma[:, None] * stretch),
        quats=quats_from_matrix(jnp.matmul(turn, axes, precision=jax.lax.Precision.HIGHEST)),
        opacity_logits=jnp.full(count, jnp.log(config.opacity / (1 - config.opacity))),
        sh=sh_from_rgb(_box_colour(panorama.rgb, stride)[chosen].reshape(-1, 1, 3)),
        alive=alive,
    )


lift = jax.jit(_lift, static_argnames=("config",))
