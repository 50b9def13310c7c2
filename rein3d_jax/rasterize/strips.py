"""Which columns a splat reaches in one row of tiles: the strip of its ellipse there, not of its bounding box.

Only pixel centres count. Margins cover float32: a hundredth of a pixel, and a thousandth of the splat, because near
an ellipse's tip its width goes as the square root of what is left (sqrt(1e-7) = 3e-4). A tile too many costs time; a
pixel lost would show.
"""

import jax
import jax.numpy as jnp

from rein3d_jax.conventions import EQUIRECTANGULAR
from rein3d_jax.rasterize.config import RasterizeConfig
from rein3d_jax.rasterize.pixels import grid
from rein3d_jax.rasterize.project import Splats
from rein3d_jax.scene import Camera

_MARGIN = 0.01  # pixels
_TIP = 1e-3  # of a splat's reach


def tile_rows(splats: Splats, camera: Camera, *, config: RasterizeConfig) -> tuple[jax.Array, jax.Array]:
    """First row of tiles (n,) of each splat, and how many (n,): 0 where it is not visible."""
    rows, _ = grid(camera, config.tile)
    first, count = _tiles(splats.box[:, 1] - _MARGIN, splats.box[:, 3] + _MARGIN, config.tile)
    last = jnp.clip(first + count - 1, -1, rows - 1)
    first = jnp.clip(first, 0, rows)
    return first, jnp.where(splats.visible, jnp.maximum(last - first + 1, 0), 0)


def tile_columns(
    splats: Splats, ids: jax.Array, row: jax.Array, camera: Camera, *, config: RasterizeConfig
) -> tuple[jax.Array, jax.Array]:
    """First column of tiles (r,) that splat `ids` (r,) reaches in the row of tiles `row` (r,), and how many (r,).
    On a panorama the first may lie left of the seam, to be taken modulo the number of columns."""
    _, columns = grid(camera, config.tile)
    top = row.astype(jnp.float32) * config.tile + 0.5
    bottom = top + config.tile - 1
    if camera.model == EQUIRECTANGULAR:
        first, count = _tiles(*_sphere_span(splats, ids, top, bottom, camera), config.tile)
        return first, jnp.clip(count, 0, columns)
    first, count = _tiles(*_pinhole_span(splats, ids, top, bottom), config.tile)
    last = jnp.minimum(first + count - 1, columns - 1)
    first = jnp.maximum(first, 0)
    return first, jnp.maximum(last - first + 1, 0)


def _tiles(low, high, tile):
    """First tile with a pixel centre in [low, high], and the number of such tiles."""
    low, high = jnp.clip(low, -1e6, 1e6), jnp.clip(high, -1e6, 1e6)
    first = jnp.ceil((low - tile + 0.5) / tile).astype(jnp.int32)
    return first, jnp.floor((high - 0.5) / tile).astype(jnp.int32) - first + 1


def _pinhole_span(splats, ids, top, bottom):
    """Ellipse |U d| <= s, U = [[a, b], [0, c]]: in row y, x runs over (-b y -+ sqrt(s^2 - c^2 y^2)) / a, farthest
    at y = -+ b s / (c sqrt(b^2 + c^2)). Left and right end (r,) in pixels; left > right where there is none."""
    mean_x, mean_y = splats.mean[ids, 0], splats.mean[ids, 1]
    a, b, c = splats.axes[ids, 0, 0], splats.axes[ids, 0, 1], splats.axes[ids, 1, 1]
    s = splats.support[ids]
    height = s / c
    low = jnp.maximum(top - mean_y - _MARGIN, -height)
    high = jnp.minimum(bottom - mean_y + _MARGIN, height)
    slant = jnp.hypot(b, c)
    tip = b * height / slant  # where x is least; it is greatest at -tip
    margin = _MARGIN + _TIP * s * slant / (a * c)

    def reach(y, sign):
        return (sign * jnp.sqrt(jnp.maximum(s * s - (c * y) ** 2, 0.0)) - b * y) / a

    left = mean_x + reach(jnp.clip(tip, low, high), -1) - margin
    right = mean_x + reach(jnp.clip(-tip, low, high), 1) + margin
    none = (low > high) | ~(s > 0)
    return jnp.where(none, 1.0, left), jnp.where(none, 0.0, right)


def _sphere_span(splats, ids, top, bottom, camera):
    """Cap of `angle` t around latitude p0: at latitude p its half width in azimuth, d, has (haversines)
    sin^2(d / 2) = (sin^2(t / 2) - sin^2((p - p0) / 2)) / (cos p cos p0), greatest at sin p = sin p0 / cos t or, where
    the cap holds a pole, at an end of the strip. Left and right end (r,) in pixels."""
    pitch = jnp.pi / camera.height
    azimuth, latitude = splats.place[ids, 0], splats.place[ids, 1]
    angle = splats.place[ids, 2] * (1 + _TIP) + _MARGIN * pitch
    high, low = jnp.pi / 2 - top * pitch, jnp.pi / 2 - bottom * pitch
    widest = jnp.arcsin(jnp.clip(jnp.sin(latitude) / jnp.maximum(jnp.cos(angle), 1e-6), -1.0, 1.0))

    def sine_squared(p):
        rest = jnp.sin(angle / 2) ** 2 - jnp.sin((p - latitude) / 2) ** 2
        return rest / jnp.maximum(jnp.cos(p) * jnp.cos(latitude), 1e-12)

    most = jnp.maximum(jnp.maximum(sine_squared(low), sine_squared(high)), sine_squared(jnp.clip(widest, low, high)))
    half = 2 * jnp.arcsin(jnp.sqrt(jnp.clip(most, 0.0, 1.0))) / (2 * jnp.pi) * camera.width
    u = (azimuth / (2 * jnp.pi) + 0.5) * camera.width
    none = most < 0
    return jnp.where(none, 1.0, u - half - _MARGIN), jnp.where(none, 0.0, u + half + _MARGIN)
