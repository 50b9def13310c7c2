"""Panorama + distance -> Gaussians: one splat for each equirectangular pixel (paper Sec. 3.1).

Centre by back-projection, colour from the pixel, size from the pixel's footprint on the sphere at its distance, high
opacity. The paper's splats are balls of the pixel's colour. Gaps open between balls where a surface that was seen at a
slant is seen from elsewhere, so ours lie along the surface; and balls let 4 % of what is behind a wall through and
blur half of a photo's detail away, so ours overlap and are coloured as `appearance` says. Everything scales with the
distance; nothing here is in absolute metres.
"""

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.sphere import pixel_rays
from rein3d_jax.lift.config import LiftConfig
from rein3d_jax.lift.patches import Patches, gaussians_of, pixel_traits, with_steps
from rein3d_jax.scene import Gaussians, Panorama


def lift(
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
    distance, known = with_steps(panorama, config)
    config = dataclasses.replace(config, snap_edges=False)  # the rest is one program, whether edges were snapped or not
    return _lift(panorama.rgb, distance, known, select, world_from_camera, config)


@partial(jax.jit, static_argnums=5)
def _lift(rgb, distance, known, select, world_from_camera, config: LiftConfig) -> Gaussians:
    height, width = distance.shape
    traits = pixel_traits(rgb, distance, known, config)
    middle = pixel_rays(height, width) * distance[..., None]
    patches = Patches(middle, jnp.ones((height, width, 2)), traits, select & known)
    flat = jax.tree.map(lambda x: x.reshape(height * width, *x.shape[2:]), patches)
    return gaussians_of(flat, world_from_camera, pitch=jnp.pi / height, config=config)
