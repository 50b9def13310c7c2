"""Panorama + distance -> Gaussians, as many as are needed: large ones where the picture is smooth and the surface flat,
pixel-sized ones at edges and on texture.

A leaf of the partition becomes one Gaussian with the leaf's mean colour. Its middle lies on the leaf's plane, its axes
along it, and from where it was lifted it is as large beside its neighbours as a pixel's splat beside a pixel's.
"""

import dataclasses
import math
from functools import partial

import jax
import jax.numpy as jnp

from rein3d_jax.errors import InputError
from rein3d_jax.geometry.morphology import window_range
from rein3d_jax.geometry.sphere import pixel_rays
from rein3d_jax.lift.config import LiftConfig
from rein3d_jax.lift.leaf_cost import largest_side, leaf_costs, levels_of
from rein3d_jax.lift.lift import lift
from rein3d_jax.lift.partition import Leaves, Level, partition
from rein3d_jax.lift.patches import Patches, gaussians_of, pixel_traits, with_steps
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
    distance, known = with_steps(panorama, config)
    config = dataclasses.replace(config, snap_edges=False)  # the rest is one program, whether edges were snapped or not
    wanted = known & select
    leaves = partition(leaf_costs(panorama.rgb, distance, wanted, config=config), wanted, capacity, config.worth)
    return _gaussians_of(leaves, panorama.rgb, distance, known, world_from_camera, config)


@partial(jax.jit, static_argnums=5)
def _gaussians_of(leaves: Leaves, rgb, distance, known, world_from_camera, config: LiftConfig) -> Gaussians:
    height, width = distance.shape
    mean, alive = _means(leaves, capacity_of(height, width, config))
    traits = pixel_traits(rgb, distance, known, config)
    wide = _overlap_of_leaves(traits.overlap, leaves, levels_of(height, width, config.max_leaf_side))
    traits = jax.tree.map(mean, traits.replace(overlap=wide))
    ray, inverse = mean(pixel_rays(height, width)), mean(1 / distance)
    # Over a plane inverse distance is linear in the ray: the mean ray over the mean inverse lies on it.
    middle = ray / jnp.where(alive, inverse, 1.0)[:, None]
    sides = jnp.where(alive[:, None], mean(leaves.sides.astype(jnp.float32)), 1.0)
    traits = traits.replace(overlap=jnp.where(alive, traits.overlap, 1.0))
    patches = Patches(middle, sides, traits, alive)
    return gaussians_of(patches, world_from_camera, pitch=jnp.pi / height, config=config)


def _overlap_of_leaves(overlap: jax.Array, leaves: Leaves, levels: list[Level]) -> jax.Array:
    """The overlap (h, w) of each pixel's leaf: the least of it and the eight of its size around it. A leaf's flanks
    reach as far beyond it as it is wide, and would lie on its neighbours' detail."""
    height, width = overlap.shape
    for rows, columns in ((1 << j, 1 << k) for j, k in levels[1:]):
        least, _ = window_range(overlap.reshape(height // rows, rows, width // columns, columns).min((1, 3)))
        here = (leaves.sides == jnp.array([rows, columns])).all(-1)
        overlap = jnp.where(here, jnp.repeat(jnp.repeat(least, rows, axis=0), columns, axis=1), overlap)
    return overlap


def _means(leaves: Leaves, capacity: int):
    """A function that takes the mean of (h, w, ...) over each leaf, 0 where there is none; (capacity,) whether there
    is."""
    label = leaves.label.ravel()

    def total(x):
        return jax.ops.segment_sum(x.reshape(label.size, *x.shape[2:]), label, capacity)

    size = total(jnp.ones(leaves.label.shape))
    return lambda x: total(x) / jnp.maximum(size, 1).reshape(-1, *[1] * (x.ndim - 2)), size > 0
