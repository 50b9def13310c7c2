"""Panorama + distance -> Gaussians: one splat for each equirectangular pixel (paper Sec. 3.1).

Centre by back-projection, colour from the pixel, size from the pixel's footprint on the sphere at its distance, high
opacity. The paper's splats are balls, and gaps open between them where a surface that was seen at a slant is seen from
elsewhere. Ours lie along the surface, stretched so that from where they were lifted they are as round as balls.
Everything scales with the distance; nothing here is in absolute metres.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.rotations import quats_from_matrix
from rein3d_jax.geometry.safe import safe_norm
from rein3d_jax.geometry.sphere import latitudes, rays_of_pose, world_from_panorama
from rein3d_jax.geometry.spherical_harmonics import sh_from_rgb
from rein3d_jax.lift.edges import snap_edges
from rein3d_jax.lift.surface import slopes, surface_axes
from rein3d_jax.scene import Gaussians, Panorama
from rein3d_jax.settings import Settings, setting


@dataclass(frozen=True)
class LiftConfig(Settings):
    """The lift's settings: how a panorama becomes Gaussians."""

    capacity: int = setting(0, "slots for Gaussians; 0: twice the lifted ones, room to explore", within="[0, inf)")
    opacity: float = setting(0.99, "opacity of every Gaussian", within="(0, 1)")
    footprint: float = setting(0.85, "sigma over half the diagonal of a pixel's footprint", within="(0, inf)")
    steepest: float = setting(6.0, "tangent of incidence up to which splats are stretched; 0: never", within="[0, inf)")
    thickness: float = setting(0.3, "a splat's extent across its surface, over its width", within="(0, inf)")
    share: float = setting(1.0, "Gaussians for each pixel at most, larger ones where it is smooth", within="(0, 1]")
    # The next three are for a share below 1.
    max_leaf_side: int = setting(16, "side of what one Gaussian stands for at most", within="[1, inf)", unit="pixels")
    flatness: float = setting(0.003, "relative distance of a surface from its Gaussian's plane", within="[0, inf)")
    leaf_step: float = setting(0.05, "relative step of inverse distance that no Gaussian spans", within="[0, inf)")
    snap_edges: bool = setting(True, "make the blurred ramps of a distance map's edges steps again")
    # At 256 x 512, 24 links hold a step blurred by a Gaussian of 3 pixels (4 % of the pixels off both surfaces before,
    # none after; with 16 links still 4 %). The price on exact, furnished rooms of that size: 1.2 % of the pixels move
    # by more than 2 % (faces seen nearly edge-on); 1.0 % with 16 links.
    edge_ramp: int = setting(24, "width of the widest ramp that is made a step", within="[1, inf)", unit="pixels")
    edge_step: float = setting(0.1, "relative change of distance across an edge, at least", within="[0, inf)")
    edge_slope: float = setting(0.01, "relative change per pixel of the surfaces beside a ramp", within="[0, inf)")


def with_steps(distance: jax.Array, known: jax.Array, config: LiftConfig) -> jax.Array:
    """The distance (h, w) with its blurred edges made steps, if the config says so."""
    if not config.snap_edges:
        return distance
    return snap_edges(distance, known, ramp=config.edge_ramp, step=config.edge_step, slope=config.edge_slope)


def footprint_sigma(distance: jax.Array, row_pitch: float, latitude: jax.Array, footprint: float) -> jax.Array:
    """A splat's sigma = footprint * half the diagonal of a footprint `distance * pitch` high and cos(latitude) times as
    wide.

    Half the diagonal is how far the splat must reach (its pixel's corner), so it follows the shrinking of a row but
    not to 0, where rows stay a pitch apart. Least alpha at pixel corners within 15 degrees of a floor's pole, seen
    from the origin, and least alpha of that cap from 0.5 m away (64 x 128, floor 1.6 m below, sigma 0.6 of a
    pitch on the horizon): half diagonal 0.997 and 0.953; arithmetic mean of the sides 0.975, 0.924; geometric mean
    0.043, 0.244 (ring-shaped holes); smaller side 0, 0; larger side 1, 0.997, but it does not shrink at all.
    `footprint` 0.85 is sigma = 0.6 pitch at the horizon: alpha 0.95 at the corners, 74 % contrast left at a period
    of 4 pixels. sigma 0.5: 0.84 and 85 % (the background shows through); 0.7: 0.986 and 61 %.
    """
    return footprint * distance * row_pitch * 0.5 * jnp.sqrt(1 + jnp.cos(latitude) ** 2)


def _lift(
    panorama: Panorama, world_from_camera: jax.Array, select: jax.Array, *, config: LiftConfig = LiftConfig()
) -> Gaussians:
    """Gaussians of capacity h * w, row by row, spherical harmonics of degree 0.

    `world_from_camera` (4, 4) is the panorama's pose in OpenCV axes; the input's is rigid(world_from_camera_axes(), 0).
    `select` (h, w) bool says which pixels become Gaussians; of these, the ones whose distance is known come alive.
    Source: paper Sec. 3.1.
    """
    height, width = panorama.distance.shape
    assert panorama.rgb.shape == (height, width, 3), panorama.rgb.shape
    assert select.shape == panorama.valid.shape == (height, width), (select.shape, panorama.valid.shape)
    known = panorama.valid & (panorama.distance > 0)
    distance = with_steps(panorama.distance, known, config)
    alive = (select & known).ravel()
    slope = slopes(distance, known)
    slope *= jnp.minimum(1.0, config.steepest / jnp.maximum(safe_norm(slope, keepdims=True), 1e-6))
    axes, tangent = (x.reshape(-1, *x.shape[2:]) for x in surface_axes(slope, height, width))
    distance = jnp.where(alive, distance.ravel(), 1.0)
    rays = rays_of_pose(world_from_camera, height, width).reshape(-1, 3)
    sigma = footprint_sigma(distance, jnp.pi / height, jnp.repeat(latitudes(height), width), config.footprint)
    along, across = jnp.sqrt(1 + tangent**2), jnp.ones_like(tangent)
    stretch = jnp.stack([along, across, config.thickness * across], axis=-1)
    rotation = world_from_panorama(world_from_camera)
    return Gaussians(
        means=rays * distance[:, None] + world_from_camera[:3, 3],
        log_scales=jnp.log(sigma[:, None] * stretch),
        quats=quats_from_matrix(jnp.matmul(rotation, axes, precision=jax.lax.Precision.HIGHEST)),
        opacity_logits=jnp.full(distance.shape, jnp.log(config.opacity / (1 - config.opacity))),
        sh=sh_from_rgb(panorama.rgb.reshape(-1, 1, 3)),
        alive=alive,
    )


lift = jax.jit(_lift, static_argnames=("config",))
