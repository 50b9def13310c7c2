"""Pixel features, whole and by tile: what `project.Splats` are evaluated against."""

import jax
import jax.numpy as jnp

from rein3d_jax.conventions import EQUIRECTANGULAR
from rein3d_jax.geometry.sphere import azimuths, latitudes, pixel_rays, world_from_camera_axes
from rein3d_jax.scene import Camera


def grid(camera: Camera, tile: int) -> tuple[int, int]:
    """Rows and columns of tiles that cover the image."""
    return -(-camera.height // tile), -(-camera.width // tile)


def pixel_features(camera: Camera) -> jax.Array:
    """Features (height, width, k): (u, v) of a pinhole camera's pixels, unit rays in camera axes of a panorama's."""
    if camera.model == EQUIRECTANGULAR:
        rays = pixel_rays(camera.height, camera.width)
        return jnp.matmul(rays, world_from_camera_axes(), precision="highest")  # by default a TPU keeps 8 bits
    u, v = jnp.meshgrid(jnp.arange(camera.width) + 0.5, jnp.arange(camera.height) + 0.5)
    return jnp.stack([u, v], axis=-1)


def tile_pixels(camera: Camera, tile: int) -> tuple[jax.Array, jax.Array]:
    """The `pixel_features` as an anchor for each tile, (tiles, k), and the pixels' offsets from it, (tiles, k, tile^2);
    a flat image's tiles all have the same, (1, k, tile^2). Pixels below the image repeat its last row."""
    rows, columns = grid(camera, tile)
    if camera.model != EQUIRECTANGULAR:
        v, u = jnp.meshgrid(jnp.arange(rows) * tile, jnp.arange(columns) * tile, indexing="ij")
        y, x = jnp.meshgrid(jnp.arange(tile), jnp.arange(tile), indexing="ij")
        corners, within = jnp.stack([u.ravel(), v.ravel()], axis=-1), jnp.stack([x.ravel(), y.ravel()])
        return corners + tile / 2.0, within[None] + 0.5 - tile / 2.0
    # Products of rows and columns: 401k pixels cost as many sines as there are rows and columns.
    last = jnp.minimum(jnp.arange(rows * tile), camera.height - 1)
    latitude = latitudes(camera.height)[last].reshape(rows, 1, tile, 1)
    azimuth = azimuths(camera.width).reshape(1, columns, 1, tile)
    flat = jnp.cos(latitude)
    axes = [flat * jnp.sin(azimuth), -jnp.sin(latitude) + 0 * azimuth, flat * jnp.cos(azimuth)]
    rays = jnp.stack(axes, axis=2).reshape(rows * columns, 3, tile * tile)
    anchors = jnp.mean(rays, axis=-1)
    return anchors, rays - anchors[..., None]


def from_tiles(tiles: jax.Array, camera: Camera, tile: int) -> jax.Array:
    """The image (height, width, k) of tiles (tiles, k, tile^2)."""
    rows, columns = grid(camera, tile)
    image = tiles.reshape(rows, columns, -1, tile, tile).transpose(0, 3, 1, 4, 2)
    return image.reshape(rows * tile, columns * tile, -1)[: camera.height, : camera.width]
