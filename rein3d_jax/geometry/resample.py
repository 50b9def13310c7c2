"""Bilinear and cubic sampling of equirectangular images, seamless across +-180 degrees and over the poles."""

from functools import partial

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.pinhole import pinhole_rays
from rein3d_jax.geometry.sphere import pixels_from_rays
from rein3d_jax.scene import Camera


def pad_sphere(image: jax.Array, pad: int) -> jax.Array:
    """The image with a rim: (h, w, ...) -> (h + 2 pad, w + 2 pad, ...). Columns wrap; a row beyond a pole is the row on
    this side of it, rotated by half a circle."""
    over_pole = jnp.roll(image, image.shape[1] // 2, axis=1)
    tall = jnp.concatenate([over_pole[:pad][::-1], image, over_pole[image.shape[0] - pad :][::-1]], axis=0)
    return jnp.concatenate([tall[:, tall.shape[1] - pad :], tall, tall[:, :pad]], axis=1)


def sample_sphere(image: jax.Array, u: jax.Array, v: jax.Array) -> jax.Array:
    """Bilinear values of `image` (h, w, ...) at continuous pixels u, v (...), u in [0, w], v in [0, h]."""
    padded = pad_sphere(image, 1)
    x, y = u + 0.5, v + 0.5  # index of the pixel centre, one pixel of padding added
    x0 = jnp.clip(jnp.floor(x).astype(jnp.int32), 0, padded.shape[1] - 2)
    y0 = jnp.clip(jnp.floor(y).astype(jnp.int32), 0, padded.shape[0] - 2)
    extra = (None,) * (image.ndim - 2)
    fx, fy = (x - x0)[(..., *extra)], (y - y0)[(..., *extra)]
    top = padded[y0, x0] * (1 - fx) + padded[y0, x0 + 1] * fx
    bottom = padded[y0 + 1, x0] * (1 - fx) + padded[y0 + 1, x0 + 1] * fx
    return top * (1 - fy) + bottom * fy


def sample_sphere_cubic(image: jax.Array, u: jax.Array, v: jax.Array) -> jax.Array:
    """Values of `image` (h, w, ...) at continuous pixels u, v (...) by cubics through 4 x 4 pixels (Keys 1981,
    a = -1/2, exact for parabolas): sharper than `sample_sphere`, and may overshoot at a step."""
    padded = pad_sphere(image, 2)
    x, y = u + 1.5, v + 1.5
    x0 = jnp.clip(jnp.floor(x).astype(jnp.int32), 1, padded.shape[1] - 3)
    y0 = jnp.clip(jnp.floor(y).astype(jnp.int32), 1, padded.shape[0] - 3)
    extra = (None,) * (image.ndim - 2)
    across, down = ([w[(..., *extra)] for w in _cubic_weights(t)] for t in (x - x0, y - y0))
    rows = (sum(padded[y0 + j - 1, x0 + i - 1] * across[i] for i in range(4)) for j in range(4))
    return sum(row * weight for row, weight in zip(rows, down, strict=True))


def _cubic_weights(t: jax.Array) -> tuple[jax.Array, ...]:
    """Of the pixels at -1, 0, 1, 2 for a place t in [0, 1]."""
    return (
        ((2 - t) * t - 1) * t / 2,
        ((3 * t - 5) * t * t + 2) / 2,
        ((4 - 3 * t) * t + 1) * t / 2,
        (t - 1) * t * t / 2,
    )


def perspective_crop(image: jax.Array, world_from_panorama: jax.Array, camera: Camera) -> jax.Array:
    """What a pinhole `camera` that stands where the panorama was taken sees of `image` (h, w, ...)."""
    exact = partial(jnp.matmul, precision=jax.lax.Precision.HIGHEST)  # an accelerator's default is 10 bits
    rotation = exact(world_from_panorama[:3, :3].T, camera.world_from_camera[:3, :3])
    rays = exact(pinhole_rays(camera.height, camera.width, camera.focal, camera.centre), rotation.T)
    # pixels_from_rays speaks of the world axes of a panorama that is not rotated: +X is camera +z, +Y is -x, +Z is -y.
    rays = jnp.stack([rays[..., 2], -rays[..., 0], -rays[..., 1]], axis=-1)
    return sample_sphere(image, *pixels_from_rays(rays, image.shape[0], image.shape[1]))
