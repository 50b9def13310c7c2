"""The slow dense oracle: every Gaussian at every pixel, no tiles, no chunks, no custom gradient.

It shares `project` with the fast path (projection has oracles of its own) and nothing after it. Tests
compare values and gradients with it, in float64 where x64 is enabled.
"""

import jax
import jax.numpy as jnp

from rein3d_jax.conventions import ALPHA_CUT, ALPHA_MAX
from rein3d_jax.geometry.safe import safe_divide
from rein3d_jax.rasterize.config import RasterizeConfig
from rein3d_jax.rasterize.pixels import pixel_features
from rein3d_jax.rasterize.project import project
from rein3d_jax.scene import Camera, Gaussians


def rasterize_reference(gaussians: Gaussians, camera: Camera, *, config: RasterizeConfig) -> tuple:
    """Premultiplied rgb (h, w, 3), alpha (h, w), weighted inverse distance (h, w), in O(n h w) time and memory."""
    splats = project(gaussians, camera, config=config)
    order = jnp.argsort(jnp.where(splats.visible, splats.distance, jnp.inf))
    splats = jax.tree.map(lambda x: x[order], splats)
    offset = pixel_features(camera)[None] - splats.mean[:, None, None, :]
    whitened = jnp.einsum("nij,nhwj->nhwi", splats.axes, offset, precision="highest")
    power = splats.log_opacity[:, None, None] - 0.5 * jnp.sum(whitened**2, axis=-1)
    raw = jnp.exp(jnp.where(splats.visible[:, None, None], power, -jnp.inf))
    alpha = jnp.where(raw < ALPHA_CUT, 0.0, jnp.minimum(raw, ALPHA_MAX))
    through = jnp.cumprod(1 - alpha, axis=0)
    weight = alpha * jnp.concatenate([jnp.ones_like(through[:1]), through[:-1]])
    rgb = jnp.einsum("nhw,nc->hwc", weight, splats.rgb, precision="highest")
    inverse = jnp.einsum("nhw,n->hw", weight, safe_divide(jnp.ones(()), splats.distance), precision="highest")
    return rgb, 1 - through[-1], inverse
