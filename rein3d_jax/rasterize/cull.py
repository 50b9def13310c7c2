"""Which Gaussians a camera could see, by a test far cheaper than projecting them."""

import jax
import jax.numpy as jnp

from rein3d_jax.conventions import PINHOLE
from rein3d_jax.geometry.poses import invert
from rein3d_jax.rasterize.config import RasterizeConfig
from rein3d_jax.scene import Camera, Gaussians

_SUPPORT = 3.33  # sigmas to the 1/255 cut of an opaque splat: sqrt(2 ln 255)


def in_view(gaussians: Gaussians, camera: Camera, *, config: RasterizeConfig) -> jax.Array:
    """The mask (n,) bool, conservative: every Gaussian that `project` finds visible is in view.

    Pinhole: the ball of 3.33 sigma, and of the filter's reach, touches the frustum's four planes; a panorama
    sees everything alive.
    """
    if camera.model != PINHOLE:
        return gaussians.alive
    pose = invert(camera.world_from_camera)
    points = jnp.matmul(gaussians.means, pose[:3, :3].T, precision="highest") + pose[:3, 3]
    x, y, z = jnp.moveaxis(points, -1, 0)
    sigma = jnp.exp(jnp.clip(jnp.max(gaussians.log_scales, axis=-1), -18.5, 7.0))
    size = jnp.array([camera.width, camera.height], jnp.float32)
    # The filter reaches so many pixels; one more for rounding. EWA may stretch a splat near the edge by
    # its slope: the radius is measured against planes of unit normal times that stretch.
    blur = _SUPPORT * config.filter_variance**0.5 + 1.0
    low = (-camera.centre - blur) / camera.focal
    high = (size - camera.centre + blur) / camera.focal
    stretch = 1.0 + 1.3 * jnp.max(jnp.maximum(jnp.abs(low), jnp.abs(high)))
    radius = _SUPPORT * sigma * stretch
    inside = (x - low[0] * z > -radius) & (high[0] * z - x > -radius)
    inside &= (y - low[1] * z > -radius) & (high[1] * z - y > -radius)
    return gaussians.alive & inside & (z > config.near) & (z < config.far)


def at_least_one(gaussians: Gaussians) -> Gaussians:
    """The same, or for a scene of no Gaussians a dead one: buffers of no size have no shape to work on."""
    if gaussians.alive.shape[0]:
        return gaussians
    return jax.tree.map(lambda x: jnp.zeros((1, *x.shape[1:]), x.dtype), gaussians)


def gather_in_view(gaussians: Gaussians, mask: jax.Array, capacity: int) -> tuple[Gaussians, jax.Array]:
    """The Gaussians of `mask` (n,) in a buffer of `capacity`, and their indices (n where empty)."""
    count = mask.shape[0]
    if capacity >= count:
        return gaussians.replace(alive=mask), jnp.arange(count)
    ids = jnp.nonzero(mask, size=capacity, fill_value=count)[0]
    gathered = jax.tree.map(lambda x: jnp.take(x, ids, axis=0, mode="clip"), gaussians)
    return gathered.replace(alive=gathered.alive & (ids < count)), ids
