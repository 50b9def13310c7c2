"""Pixel features by tile: what `project.Splats` are evaluated against."""

import jax
import jax.numpy as jnp

from rein3d_jax.conventions import EQUIRECTANGULAR
from rein3d_jax.geometry.sphere import pixel_rays, world_from_camera_axes
from rein3d_jax.scene import Camera


def grid(camera: Camera, tile: int) -> tuple[int, int]:
    """(rows, columns) of tiles that cover the image."""
    return -(-camera.height // tile), -(-camera.width // tile)


def features(camera: Camera) -> jax.Array:
    """(height, width, k): (u, v) of a pinhole camera's pixels, unit rays in camera axes of a panorama's."""
    if camera.model == EQUIRECTANGULAR:
        rays = pixel_rays(camera.height, camera.width)
        return jnp.matmul(rays, world_from_camera_axes(), precision="highest")  # by default a TPU keeps 8 bits
    u, v = jnp.meshgrid(jnp.arange(camera.width) + 0.5, jnp.arange(camera.height) + 0.5)
    return jnp.stack([u, v], axis=-1)


def to_tiles(image: jax.Array, tile: int) -> jax.Array:
    """(h, w, k) -> (tiles, tile^2, k), edges padded by repeating the last pixel."""
    rows, columns = -(-image.shape[0] // tile), -(-image.shape[1] // tile)
    pad = ((0, rows * tile - image.shape[0]), (0, columns * tile - image.shape[1]), (0, 0))
    image = jnp.pad(image, pad, mode="edge").reshape(rows, tile, columns, tile, -1)
    return image.transpose(0, 2, 1, 3, 4).reshape(rows * columns, tile * tile, -1)


def from_tiles(tiles: jax.Array, height: int, width: int, tile: int) -> jax.Array:
    """Inverse of `to_tiles`: (tiles, tile^2, k) -> (height, width, k)."""
    rows, columns = -(-height // tile), -(-width // tile)
    image = tiles.reshape(rows, columns, tile, tile, -1).transpose(0, 2, 1, 3, 4)
    return image.reshape(rows * tile, columns * tile, -1)[:height, :width]
