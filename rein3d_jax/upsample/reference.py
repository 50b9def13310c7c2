"""Super-resolution by reference: where a frame shows a surface that the input panorama saw, the input's own pixels."""

import math

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.geometry.morphology import window_range
from rein3d_jax.geometry.pyramid import halve, levels
from rein3d_jax.geometry.resample import sample_sphere_cubic
from rein3d_jax.geometry.safe import safe_norm
from rein3d_jax.geometry.sphere import holding_pixels, latitudes, pixels_from_rays, rays_of_pose
from rein3d_jax.scene import Panorama
from rein3d_jax.upsample.distance import SAME_SURFACE

_RELATIVE = 0.03  # a surface this little off the one that was seen is that one
_COARSEST = 3  # halvings of the input that a frame may call for


@struct.dataclass
class Reference:
    """What the input knows of a frame."""

    rgb: jax.Array  # (h, w, 3) sRGB, as fine as the frame's pixels
    weight: jax.Array  # (h, w) in [0, 1]: 1 where the input is as fine as the frame, 0 where half as fine or not seen


@jax.jit
def reference_colours(panorama: Panorama, pose: jax.Array, distance: jax.Array) -> Reference:
    """The Reference of a frame at `pose` (4, 4) whose surfaces lie at `distance` (h, 2 h), 0 where unknown, by the
    input `panorama` at the world's origin."""
    height, width = distance.shape
    points = pose[:3, 3] + rays_of_pose(pose, height, width) * distance[..., None]
    reach = safe_norm(points)
    ray = points / jnp.maximum(reach, 1e-6)[..., None]
    u, v = pixels_from_rays(ray, *panorama.distance.shape)
    measured = _away_from_edges(jnp.where(panorama.valid, panorama.distance, 0.0))
    there = measured[holding_pixels(u, v, *measured.shape)]
    seen = (distance > 0) & (jnp.abs(reach - there) < _RELATIVE * there)
    across, down = _steps(ray, 1), _steps(ray, 0)
    pitch, own = math.pi / len(panorama.rgb), math.pi / height
    size = jnp.maximum(across, down) / pitch  # of the frame's pixel, in the input's
    rgb = _at_level(panorama.rgb, u, v, jnp.log2(jnp.maximum(size, 1.0)))
    # A pixel of the input covers as much as one of the frame (1), or as two (0), on the axis where it covers more.
    finest = jnp.minimum(across / jnp.cos(latitudes(height))[:, None], down) / own * (len(panorama.rgb) / height)
    return Reference(rgb, jnp.where(seen, jnp.clip(2 * finest - 1, 0, 1), 0.0))


def _away_from_edges(distance: jax.Array) -> jax.Array:
    """The distance, 0 where 3 x 3 pixels see more than one surface: colours are mixed there."""
    least, most = window_range(distance)
    return jnp.where(most < SAME_SURFACE * least, distance, 0.0)


def _steps(ray: jax.Array, axis: int) -> jax.Array:
    """Radians from pixel to pixel along an axis: the smaller of both sides', which spans no edge."""
    step = safe_norm(jnp.roll(ray, -1, axis) - ray)
    if axis == 0:  # the last row has no next one
        step = step.at[-1].set(step[-2])
        return jnp.minimum(step, jnp.concatenate([step[:1], step[:-1]]))
    return jnp.minimum(step, jnp.roll(step, 1, axis))


def _at_level(image: jax.Array, u: jax.Array, v: jax.Array, level: jax.Array) -> jax.Array:
    """Values of an image at pixels u, v, halved `level` times."""
    count = min(_COARSEST, levels(len(image)))
    level = jnp.clip(level, 0, count)[..., None]
    found = 0.0
    for index in range(count + 1):
        share = jnp.clip(1 - jnp.abs(level - index), 0, 1)
        found += share * sample_sphere_cubic(image, u / 2**index, v / 2**index)
        if index < count:
            image = halve(image)
    return found
