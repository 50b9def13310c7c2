"""The network's input of a clip: what was rendered, several fills of its holes, and where each frame stands.

All is relative to the clip's own scales, so that metres twice as long, or a darker picture, change nothing: distances
enter as logarithms over its length, colours about its mean and over its contrast.
"""

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.geometry.sphere import azimuths, horizontal_direction, latitudes

CANDIDATES = 3  # fills of a hole: from the shell; from the far side; from the shell, and what its windows show
FEATURES = 28
_FAINT = 0.05  # contrast below which a picture's noise would be blown up


@struct.dataclass
class Clip:
    """Frames of one trajectory, the anchor first, and their fills. Leading axes are free: (..., t, h, w)."""

    rgb: jax.Array  # (..., t, h, w, 3) sRGB, rendered
    alpha: jax.Array  # (..., t, h, w) 1 = observed
    distance: jax.Array  # (..., t, h, w) metres, 0 where unknown
    fill_rgb: jax.Array  # (..., t, h, w, CANDIDATES, 3) holes filled; where no shell is known, all are the second
    fill_distance: jax.Array  # (..., t, h, w, CANDIDATES) metres
    position: jax.Array  # (..., t, 3) metres from the anchor, in axes whose +X lies at the panorama's centre column


def log_distance(distance: jax.Array) -> jax.Array:
    """Logarithm of metres; 0 where the distance is unknown."""
    return jnp.log(jnp.where(distance > 0, distance, 1.0))


def log_scale(clip: Clip) -> jax.Array:
    """Length (...) of the clip itself, as a logarithm of metres: the mean over the anchor."""
    return jnp.mean(log_distance(clip.fill_distance[..., 0, :, :, 0]), axis=(-2, -1))


def tone(clip: Clip) -> tuple[jax.Array, jax.Array]:
    """Mean colour (..., 1, 1, 1, 3) and contrast (..., 1, 1, 1, 1) of the anchor."""
    anchor = clip.fill_rgb[..., :1, :, :, 0, :]
    mean = jnp.mean(anchor, axis=(-3, -2), keepdims=True)
    spread = jnp.sqrt(jnp.mean((anchor - mean) ** 2, axis=(-3, -2, -1), keepdims=True))
    return mean, jnp.maximum(spread, _FAINT)


def network_features(clip: Clip, noisy: jax.Array) -> jax.Array:
    """Features (..., t, h, w, FEATURES) of a clip and of its noisy residual (..., t, h, w, 4)."""
    scale = log_scale(clip)[..., None, None, None]
    known = clip.distance > 0
    depth = jnp.where(known, log_distance(clip.distance) - scale, 0.0) * clip.alpha
    fill = log_distance(clip.fill_distance)
    fill = jnp.concatenate([fill[..., :1] - scale[..., None], fill[..., 1:] - fill[..., :1]], axis=-1)
    mean, spread = tone(clip)
    colours = (clip.fill_rgb - mean[..., None, :]) / spread[..., None]
    colours = jnp.concatenate([colours[..., :1, :], colours[..., 1:, :] - colours[..., :1, :]], axis=-2)
    parts = [
        (clip.rgb - mean) / spread * clip.alpha[..., None],
        clip.alpha[..., None],
        (clip.alpha < 0.5)[..., None],
        depth[..., None],
        colours.reshape(*clip.alpha.shape, 3 * CANDIDATES),
        fill,
        _place(clip, scale[..., 0]),
        _latitude(clip),
        noisy / jnp.concatenate([spread, spread, spread, jnp.ones_like(spread)], axis=-1),
    ]
    joined = jnp.concatenate([x.astype(clip.rgb.dtype) for x in parts], axis=-1)
    assert joined.shape[-1] == FEATURES, joined.shape
    return joined


def _place(clip: Clip, scale: jax.Array) -> jax.Array:
    """Way (..., t, h, w, 3) from the anchor over the clip's scale: towards each column, to its right, and up."""
    ahead = azimuths(clip.alpha.shape[-1])
    moved = clip.position / jnp.exp(scale)
    along, right = (moved @ horizontal_direction(ahead + yaw).T for yaw in (0.0, jnp.pi / 2))
    up = jnp.broadcast_to(moved[..., 2:], along.shape)
    columns = jnp.stack([along, right, up], axis=-1)[..., None, :, :]
    return jnp.broadcast_to(columns, (*clip.alpha.shape, 3))


def _latitude(clip: Clip) -> jax.Array:
    row = latitudes(clip.alpha.shape[-2])
    angles = jnp.stack([jnp.sin(row), 2 * jnp.cos(row) - 1, jnp.sin(2 * row)], axis=-1)
    return jnp.broadcast_to(angles[:, None], (*clip.alpha.shape, 3))
