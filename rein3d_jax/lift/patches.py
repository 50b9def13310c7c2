"""Patches of a surface that a panorama saw, and the Gaussians that show them."""

import math
from functools import partial

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.geometry.rotations import quats_from_matrix
from rein3d_jax.geometry.safe import safe_norm
from rein3d_jax.geometry.sphere import world_from_panorama
from rein3d_jax.geometry.spherical_harmonics import sh_from_rgb
from rein3d_jax.lift.appearance import sharpened, splat_overlap
from rein3d_jax.lift.config import LiftConfig
from rein3d_jax.lift.edges import snap_edges
from rein3d_jax.lift.splat_shape import splat_shape
from rein3d_jax.lift.surface import slopes
from rein3d_jax.scene import Gaussians, Panorama


@struct.dataclass
class Traits:
    """What splats need to know of a surface besides its place; over a patch, the mean."""

    slope: jax.Array  # (..., 2) `surface.slopes`, limited
    overlap: jax.Array  # (...) sigma over half a pixel's diagonal
    rgb: jax.Array  # (..., 3) sRGB, made up for what splats blur


@struct.dataclass
class Patches:
    """What one splat each stands for."""

    middle: jax.Array  # (..., 3) metres, in the panorama's own frame
    sides: jax.Array  # (..., 2) rows and columns of pixels
    traits: Traits
    alive: jax.Array  # (...) bool


@partial(jax.jit, static_argnums=1)
def with_steps(panorama: Panorama, config: LiftConfig) -> tuple[jax.Array, jax.Array]:
    """The distance (h, w), 1 where it is unknown, its blurred edges made steps if the config says so; and where it is
    known."""
    known = panorama.valid & (panorama.distance > 0)
    distance = jnp.where(known, panorama.distance, 1.0)
    if config.snap_edges:
        chosen = {"ramp": config.edge_ramp, "step": config.edge_step, "slope": config.edge_slope}
        distance = snap_edges(distance, known, **chosen)
    return distance, known


def pixel_traits(rgb: jax.Array, distance: jax.Array, known: jax.Array, config: LiftConfig) -> Traits:
    """The Traits (h, w) of a panorama's pixels; `distance` (h, w) is any positive one where none is `known`."""
    slope = slopes(distance, known)
    slope *= jnp.minimum(1.0, config.steepest / jnp.maximum(safe_norm(slope, keepdims=True), 1e-6))
    wide = splat_overlap(rgb, detailed=config.footprint, plain=config.plain_footprint)
    return Traits(slope, wide, sharpened(rgb, config.sharpen))


def gaussians_of(patches: Patches, world_from_camera: jax.Array, *, pitch: float, config: LiftConfig) -> Gaussians:
    """One Gaussian for each of n patches of a panorama whose rows are `pitch` radians high, in the world."""
    middle = jnp.where(patches.alive[:, None], patches.middle, jnp.array([1.0, 0.0, 0.0]))
    traits = patches.traits
    axes, scales = splat_shape(
        middle, traits.slope, patches.sides, traits.overlap, pitch=pitch, thickness=config.thickness
    )
    rotation = world_from_panorama(world_from_camera)
    return Gaussians(
        means=jnp.matmul(middle, rotation.T, precision=jax.lax.Precision.HIGHEST) + world_from_camera[:3, 3],
        log_scales=jnp.log(scales),
        quats=quats_from_matrix(jnp.matmul(rotation, axes, precision=jax.lax.Precision.HIGHEST)),
        # Of float32 and no weaker: a scene that was read, or refined, would be another type, and be compiled again.
        opacity_logits=jnp.full(len(middle), math.log(config.opacity / (1 - config.opacity)), jnp.float32),
        sh=sh_from_rgb(traits.rgb[:, None]),
        alive=patches.alive,
    )
