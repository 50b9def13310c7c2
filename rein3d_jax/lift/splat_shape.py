"""The shape of a splat that stands for a rectangle of a panorama's pixels: as wide and as high as they are on the
sphere, laid along the surface.

A pixel near a pole is a sliver, and so is its splat: a ball as wide as a row is high lets 512 columns run into each
other there (a carpet at the nadir, seen from where it was taken: 17.5 dB, against 29 dB elsewhere)."""

import math

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.safe import safe_norm
from rein3d_jax.lift.surface import axes_at


def splat_shape(
    middle: jax.Array, slope: jax.Array, sides: jax.Array, overlap: jax.Array, *, pitch: float, thickness: float
) -> tuple[jax.Array, jax.Array]:
    """Axes (n, 3, 3) as columns, in the panorama's own frame, and their sigmas (n, 3) in metres, of splats at `middle`
    (n, 3) metres on a surface of `slope` (n, 2), each for `sides` (n, 2) rows and columns of `pitch` radians a row.

    Seen from the origin sigma is `overlap` (n,) times a side over sqrt(2), half the diagonal of a square: a rectangle's
    corner is as many sigmas away as a pixel's. On the surface the axes of `surface` are stretched by
    sqrt(1 + tangent^2) along the first, and the ellipse's own axes follow; across it lies `thickness` of the smaller.
    """
    away = safe_norm(middle)
    cos_latitude = safe_norm(middle[:, :2]) / away
    height, width = overlap * away * pitch / math.sqrt(2) * jnp.stack([sides[:, 0], sides[:, 1] * cos_latitude])
    down, right = height**2, width**2
    axes, tangent, way = axes_at(middle / away[:, None], slope)
    stretch = jnp.sqrt(1 + tangent**2)
    # Along and beside the slope, of variances that hold along rows and columns; beside is right where along is up.
    along = stretch**2 * (way[:, 0] ** 2 * right + way[:, 1] ** 2 * down)
    beside = way[:, 1] ** 2 * right + way[:, 0] ** 2 * down
    mixed = stretch * way[:, 0] * way[:, 1] * (right - down)
    rotated, sigmas = _ellipse(along, beside, mixed)
    thin = thickness * jnp.minimum(height, width)
    return jnp.concatenate([axes[..., :2] @ rotated, axes[..., 2:]], axis=-1), jnp.stack([*sigmas, thin], axis=-1)


def _ellipse(xx: jax.Array, yy: jax.Array, xy: jax.Array):
    """Rotations (n, 2, 2) and the two sigmas along their columns, of covariances."""
    lean = jnp.stack([(xx - yy) / 2, xy], axis=-1)
    spread, middle = safe_norm(lean), (xx + yy) / 2
    angle = jnp.where(spread > 1e-6 * middle, jnp.arctan2(xy, lean[:, 0]) / 2, 0.0)
    cos, sin = jnp.cos(angle), jnp.sin(angle)
    rotation = jnp.stack([jnp.stack([cos, -sin], axis=-1), jnp.stack([sin, cos], axis=-1)], axis=-2)
    # middle - spread by the determinant: a sliver's smaller side is far below the larger one's rounding.
    large = middle + spread
    return rotation, (jnp.sqrt(large), jnp.sqrt(jnp.maximum((xx * yy - xy * xy) / large, 1e-12 * large)))
