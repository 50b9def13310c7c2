"""The lining of sharp surfaces: a copy at half the rows, right behind them.

Splats that are narrow enough to show a photo's detail leave an eighth of what is behind them open between four of
them. From where the photo was taken no pixel is that small; where a camera comes near or looks closely it sees a weave
of whatever lies behind the wall. With a lining it is the surface's own colour.

It lies so far behind that its splats, twice as large, stay behind the sharp ones up to some 60 degrees of slant; not
beside steps of distance, where it would look out; and not where the surface was seen at a slant, since it would have
to lie far away there.
"""

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.morphology import window_sum
from rein3d_jax.geometry.pyramid import halve
from rein3d_jax.geometry.safe import safe_norm
from rein3d_jax.lift.appearance import splat_overlap
from rein3d_jax.lift.config import LiftConfig
from rein3d_jax.lift.lift import lift
from rein3d_jax.lift.surface import beside_steps, slopes
from rein3d_jax.scene import Gaussians, Panorama

_OPEN = 1.0  # overlap below which four splats leave more than a fortieth between them
_OVERLAP = 1.0  # the lining's own: its blur shows through an eighth at most
_BEHIND = 2.0  # pixels of depth, where the surface faces the camera
_STEEPEST = 1.0  # tangent of incidence up to which a surface is lined
_FROM_STEPS = 3  # pixels
_AROUND = 1  # pixel around open ones: larger splats are narrow where a neighbour is


def lining(panorama: Panorama, world_from_camera: jax.Array, *, config: LiftConfig) -> Gaussians:
    """Gaussians of capacity h / 2 * w / 2, the living ones behind what is sharp in a panorama (h, w), h even, whose
    distance is complete, at the pose `world_from_camera` (4, 4). `config` is what its surfaces were lifted with."""
    layer, lined = _layer(panorama, config)
    config = dataclasses.replace(
        config, footprint=_OVERLAP, plain_footprint=_OVERLAP, sharpen=0.0, share=1.0, snap_edges=False
    )
    return lift(layer, world_from_camera, lined, config=config)


@partial(jax.jit, static_argnums=1)
def _layer(panorama: Panorama, config: LiftConfig) -> tuple[Panorama, jax.Array]:
    """The panorama (h / 2, w / 2) that the lining shows, and where (h / 2, w / 2) bool there is any."""
    rgb, distance = panorama.rgb, panorama.distance
    inverse, pitch = 1 / distance, jnp.pi / len(distance)
    step = beside_steps(inverse, config.leaf_step)
    narrow = splat_overlap(rgb, detailed=config.footprint, plain=config.plain_footprint) < _OPEN
    apart, near = (window_sum(mask.astype(rgb.dtype), by) > 0 for mask, by in ((step, _FROM_STEPS), (narrow, _AROUND)))
    steep = safe_norm(slopes(distance, jnp.ones(distance.shape, bool)))
    masks = jnp.stack([apart, near], axis=-1).astype(rgb.dtype)
    rgb, inverse, masks, steep = (halve(x) for x in (rgb, inverse, masks, steep))
    # Along the ray, so that along the surface's normal it is _BEHIND times a pixel's length on the surface.
    behind = (1 + _BEHIND * pitch * (1 + steep**2)) / inverse
    lined = (masks[..., 0] == 0) & (masks[..., 1] > 0) & (steep < _STEEPEST)
    return Panorama(rgb, behind, jnp.ones(lined.shape, bool)), lined
