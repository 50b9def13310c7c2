"""The outside behind the room: a backdrop by direction, as far as windows may show it from the places where a camera
goes. What the panorama saw through a window is a part of it; the rest goes on from there, smoothly."""

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.geometry.morphology import window_range, window_sum
from rein3d_jax.geometry.push_pull import push_pull
from rein3d_jax.geometry.pyramid import halve
from rein3d_jax.geometry.sphere import holding_pixels, pixel_rays, pixels_from_rays
from rein3d_jax.scene import Panorama

_FAR = 4.0  # times the median known distance: what is unknown and was placed beyond shows through a window
_ROWS = 64  # of the backdrop at most: what nobody saw has no detail
_BEYOND = 1.05  # of what was seen: the backdrop stands behind it
_MARGIN = 3  # pixels of the backdrop: beside the paths there is some room
# Mean sRGB of what 312 panoramas of rendered rooms (experiments.render_rooms) show through windows, above and below.
_SKY, _GROUND = 0.76, 0.54
_MEMORY = 1.0  # radians over which what was seen ceases to tell what is beside it


@struct.dataclass
class OutsideLayer:
    """A backdrop, and whether there is any window."""

    panorama: Panorama  # (h, w), smooth
    shown: jax.Array  # (h, w) bool, directions that some window shows from some place
    there: jax.Array  # () bool


@jax.jit
def outside_of(panorama: Panorama, positions: jax.Array) -> OutsideLayer:
    """The outside of a panorama with complete distance, `valid` where it was measured, seen from `positions` (n, 3),
    world, in metres from the panorama."""
    known = panorama.valid & (panorama.distance > 0)
    median = jnp.nanmedian(jnp.where(known, panorama.distance, jnp.nan))
    window = ~known & (panorama.distance > _FAR * median)
    glass = push_pull(jnp.where(known, 1 / panorama.distance, 0.0)[..., None], known.astype(jnp.float32))[..., 0]
    clear, _ = window_range(window.astype(jnp.float32))  # at its frame the window's colours are mixed with the wall's
    clear = jnp.where(jnp.any(clear > 0), clear, window)
    rgb = push_pull(jnp.where(clear[..., None] > 0, panorama.rgb, 0.0), clear)
    share, far = window.astype(jnp.float32), _BEYOND * jnp.max(jnp.where(window, panorama.distance, 0.0))
    while rgb.shape[0] > _ROWS and rgb.shape[0] % 2 == 0:
        rgb, share, glass = (halve(x) for x in (rgb, share, glass))
    shown = _shown(share > 0.5, 1 / jnp.maximum(glass, 1e-6), positions)
    rgb = _forgetful(rgb, share > 0.5)
    distance = jnp.full(shown.shape, far)
    return OutsideLayer(Panorama(rgb, distance, jnp.ones(shown.shape, bool)), shown, jnp.any(window))


def _forgetful(rgb: jax.Array, window: jax.Array) -> jax.Array:
    """Colours (h, w, 3) that far from every window (h, w) become those of a day: what was seen tells less and less."""
    rays = pixel_rays(*window.shape)

    def toward(row):
        """Cosine (w,) of the angle to the nearest window; row by row, since all at once are 270 MB."""
        cosines = jnp.matmul(row, rays.reshape(-1, 3).T, precision="highest")
        return jnp.max(jnp.where(window.ravel(), cosines, -1.0), axis=-1)

    angle = jnp.arccos(jnp.clip(jax.lax.map(toward, rays), -1.0, 1.0))
    remembered = jnp.exp(-angle / _MEMORY)[..., None]
    day = jnp.where(rays[..., 2:] > 0, _SKY, _GROUND)
    return remembered * rgb + (1 - remembered) * day


def _shown(window: jax.Array, glass: jax.Array, positions: jax.Array) -> jax.Array:
    """Directions (h, w) bool in which a window (h, w), its glass so far away (h, w), is seen from `positions`."""
    height, width = window.shape
    points = pixel_rays(height, width) * glass[..., None]

    def marked(shown, position):
        places = pixels_from_rays(points - position, height, width)
        return shown.at[holding_pixels(*places, height, width)].max(window), None

    shown, _ = jax.lax.scan(marked, window, positions)
    return (window_sum(shown.astype(jnp.float32), _MARGIN) > 0) & jnp.any(window)
