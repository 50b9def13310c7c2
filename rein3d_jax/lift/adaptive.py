"""Panorama + distance -> Gaussians, as many as are needed: large ones where the picture is smooth and the surface flat,
pixel-sized ones at edges and on texture.

A leaf of the partition becomes one Gaussian with the leaf's mean colour. Its middle lies on the leaf's plane, its axes
along it, and from where it was lifted it covers as much as the leaf's pixels would together: the variance of a
pixel's splat, and of the places of the pixels that it stands for.
"""

import math
from functools import partial

import jax
import jax.numpy as jnp

from rein3d_jax.errors import InputError
from rein3d_jax.geometry.rotations import quats_from_matrix
from rein3d_jax.geometry.safe import safe_norm
from rein3d_jax.geometry.sphere import pixel_rays, world_from_panorama
from rein3d_jax.geometry.spherical_harmonics import sh_from_rgb
from rein3d_jax.lift.leaf_cost import largest_side, leaf_costs
from rein3d_jax.lift.lift import LiftConfig, footprint_sigma, lift, with_steps
from rein3d_jax.lift.partition import Leaves, partition
from rein3d_jax.lift.surface import axes_at, slopes
from rein3d_jax.scene import Gaussians, Panorama


def capacity_of(height: int, width: int, config: LiftConfig) -> int:
    """Gaussians that `lift_adaptively` gives at most. Raises InputError where even the largest leaves are more."""
    capacity = math.floor(config.share * height * width)
    rows, columns = (largest_side(pixels, config.max_leaf_side) for pixels in (height, width))
    fewest = height * width // (rows * columns)
    if capacity < fewest:
        raise InputError(
            f"lift.share {config.share} is {capacity:_} Gaussians, but the largest leaves, of {rows}x{columns} pixels, "
            f"are {fewest:_}; raise lift.share or lift.max_leaf_side"
        )
    return capacity


def lift_adaptively(
    panorama: Panorama, world_from_camera: jax.Array, select: jax.Array, *, config: LiftConfig
) -> Gaussians:
    """Gaussians of capacity config.share * h * w, spherical harmonics of degree 0, of the pixels in `select` (h, w)
    whose distance is known. With share 1, `lift`'s own: one for each pixel.

    `world_from_camera` (4, 4) as in `lift`. Raises InputError where the share is too small for leaves of
    config.max_leaf_side. Pure; compiled piece by piece where called outside jit (as one program it works as well, but
    XLA fuses the leaves of all sizes into each other: minutes of compiling).
    """
    if config.share >= 1:
        return lift(panorama, world_from_camera, select, config=config)
    capacity = capacity_of(*panorama.distance.shape, config)
    distance, known = _prepared(panorama, config)
    wanted = known & select
    leaves = partition(leaf_costs(panorama.rgb, distance, wanted, config=config), wanted, capacity)
    return _gaussians_of(leaves, panorama.rgb, distance, known, world_from_camera, config)


@partial(jax.jit, static_argnums=1)
def _prepared(panorama: Panorama, config: LiftConfig) -> tuple[jax.Array, jax.Array]:
    """Distances with steps where they were blurred, 1 where unknown; and where they are known."""
    known = panorama.valid & (panorama.distance > 0)
    return with_steps(jnp.where(known, panorama.distance, 1.0), known, config), known


@partial(jax.jit, static_argnums=5)
def _gaussians_of(leaves: Leaves, rgb, distance, known, world_from_camera, config: LiftConfig) -> Gaussians:
    height, width = distance.shape
    capacity = capacity_of(height, width, config)
    mean, alive = _means(leaves, capacity)
    slope = slopes(distance, known)
    slope *= jnp.minimum(1.0, config.steepest / jnp.maximum(safe_norm(slope, keepdims=True), 1e-6))
    ray, inverse, colour = mean(pixel_rays(height, width)), mean(1 / distance), mean(rgb)
    # Over a plane inverse distance is linear in the ray: the mean ray over the mean inverse lies on it.
    middle = jnp.where(alive[:, None], ray / jnp.where(alive, inverse, 1.0)[:, None], jnp.array([1.0, 0.0, 0.0]))
    sides = jnp.where(alive[:, None], mean(leaves.sides.astype(jnp.float32)), 1.0)
    axes, scales = _shape(middle, mean(slope), sides, jnp.pi / height, config)
    rotation = world_from_panorama(world_from_camera)
    return Gaussians(
        means=jnp.matmul(middle, rotation.T, precision=jax.lax.Precision.HIGHEST) + world_from_camera[:3, 3],
        log_scales=jnp.log(scales),
        quats=quats_from_matrix(jnp.matmul(rotation, axes, precision=jax.lax.Precision.HIGHEST)),
        opacity_logits=jnp.full(capacity, jnp.log(config.opacity / (1 - config.opacity))),
        sh=sh_from_rgb(colour[:, None]),
        alive=alive,
    )


def _means(leaves: Leaves, capacity: int):
    """A function that takes the mean of (h, w, ...) over each leaf, 0 where there is none; (capacity,) whether there
    is."""
    label = leaves.label.ravel()

    def total(x):
        return jax.ops.segment_sum(x.reshape(label.size, *x.shape[2:]), label, capacity)

    size = total(jnp.ones(leaves.label.shape))
    return lambda x: total(x) / jnp.maximum(size, 1).reshape(-1, *[1] * (x.ndim - 2)), size > 0


def _shape(middle: jax.Array, slope: jax.Array, sides: jax.Array, pitch: float, config: LiftConfig):
    """Axes (n, 3, 3) as columns and their sigmas (n, 3) in metres, of leaves of `sides` (rows, columns) pixels.

    Seen from the origin sigma^2 is a pixel's plus that of a leaf's places, both times its distance: a side of n pixels
    has (n^2 - 1) / 12 of them, and rho^2 (n^2 - 1) holds rho = 0.6 for pixels and leaves alike. On the surface the axes
    of `surface` are stretched by sqrt(1 + tangent^2) along the first, and the ellipse's own axes follow.
    """
    away = safe_norm(middle)
    latitude = jnp.arcsin(jnp.clip(middle[:, 2] / away, -1, 1))
    pixel = footprint_sigma(away, pitch, latitude, config.footprint)
    across = away * pitch * jnp.stack([jnp.ones_like(latitude), jnp.cos(latitude)])
    rho = config.footprint / math.sqrt(2)  # a pixel's sigma on the horizon, in pitches
    down, right = pixel**2 + (rho * across) ** 2 * (sides.T**2 - 1)
    axes, tangent, way = axes_at(middle / away[:, None], slope)
    stretch = jnp.sqrt(1 + tangent**2)
    # Along and beside the slope, of variances that hold along rows and columns; beside is right where along is up.
    along = stretch**2 * (way[:, 0] ** 2 * right + way[:, 1] ** 2 * down)
    beside = way[:, 1] ** 2 * right + way[:, 0] ** 2 * down
    mixed = stretch * way[:, 0] * way[:, 1] * (right - down)
    rotated, sigmas = _ellipse(along, beside, mixed)
    thin = config.thickness * jnp.sqrt(jnp.minimum(down, right))
    return jnp.concatenate([axes[..., :2] @ rotated, axes[..., 2:]], axis=-1), jnp.stack([*sigmas, thin], axis=-1)


def _ellipse(xx: jax.Array, yy: jax.Array, xy: jax.Array):
    """Rotations (n, 2, 2) and the two sigmas along their columns, of covariances."""
    lean = jnp.stack([(xx - yy) / 2, xy], axis=-1)
    spread, middle = safe_norm(lean), (xx + yy) / 2
    angle = jnp.where(spread > 1e-6 * middle, jnp.arctan2(xy, lean[:, 0]) / 2, 0.0)
    cos, sin = jnp.cos(angle), jnp.sin(angle)
    rotation = jnp.stack([jnp.stack([cos, -sin], axis=-1), jnp.stack([sin, cos], axis=-1)], axis=-2)
    return rotation, (jnp.sqrt(middle + spread), jnp.sqrt(jnp.maximum(middle - spread, 1e-6 * middle)))
