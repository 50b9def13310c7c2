"""Where a panorama has edges, and which way they run: the evidence a room is fitted to.

`edge_tensors` maps a picture to (h, w, 3): the symmetric 2x2 structure tensor (ee, en, nn) of each pixel in
its own (east, north) tangent frame. Its trace is near 1 on a clear edge of any contrast and near 0 on flat
and on busily textured ground, so that contrast and texture do not outvote the length of an edge.
"""

import math

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.resample import pad_sphere, sample_sphere
from rein3d_jax.geometry.sphere import latitudes, pixels_from_rays

# Luminance and two opponent chroma channels; chroma counts double, since shadows and lamps hardly move it.
OPPONENT = ((1 / 3, 1 / 3, 1 / 3), (2.0, -2.0, 0.0), (-1.0, -1.0, 2.0))


def blur(image: jax.Array, sigma: float) -> jax.Array:
    """Gaussian blur of (h, w, c) by `sigma` pixels: wraps columns, repeats the pole rows."""
    radius = math.ceil(3 * sigma)
    taps = jnp.exp(-0.5 * (jnp.arange(-radius, radius + 1) / sigma) ** 2)
    kernel = (taps / taps.sum()).astype(image.dtype)
    channels = jnp.moveaxis(image, -1, 0)[:, None]
    channels = jnp.pad(channels, ((0, 0), (0, 0), (0, 0), (radius, radius)), mode="wrap")
    channels = jax.lax.conv(channels, kernel[None, None, None, :], (1, 1), "VALID")
    channels = jnp.pad(channels, ((0, 0), (0, 0), (radius, radius), (0, 0)), mode="edge")
    channels = jax.lax.conv(channels, kernel[None, None, :, None], (1, 1), "VALID")
    return jnp.moveaxis(channels[:, 0], 0, -1)


def tangent_gradients(image: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Gradients (d/d(east), d/d(north)) of (h, w, c), each (h, w, c), per pixel of arc at the equator."""
    east = (jnp.roll(image, -1, axis=1) - jnp.roll(image, 1, axis=1)) / 2
    tall = jnp.pad(image, ((1, 1), (0, 0), (0, 0)), mode="edge")
    north = (tall[:-2] - tall[2:]) / 2
    return east / jnp.cos(latitudes(image.shape[0]))[:, None, None], north


def sharp_gradients(image: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Those of `tangent_gradients` by five taps: a difference of two neighbours tilts an edge towards the diagonal, by
    2 degrees at 15 from upright, where its blur is a pixel; this one by a quarter of that."""
    padded = pad_sphere(image, 2)
    high, wide = image.shape[:2]
    columns = [padded[2:-2, 2 + k : 2 + k + wide] for k in (-2, -1, 1, 2)]
    rows = [padded[2 + k : 2 + k + high, 2:-2] for k in (2, 1, -1, -2)]
    east, north = ((8 * (c - b) - (d - a)) / 12 for a, b, c, d in (columns, rows))
    return east / jnp.cos(latitudes(high))[:, None, None], north


def edge_tensors(rgb: jax.Array, *, noise: float, texture: float, gradients=tangent_gradients) -> jax.Array:
    """Saturated structure tensors (h, w, 3) of a picture (h, w, 3) sRGB. `noise` is the step per pixel that counts as
    half an edge on flat ground, `texture` how many times its surroundings' mean energy an edge must have; `gradients`
    is `tangent_gradients` or `sharp_gradients`, where directions must be exact."""
    east, north = gradients(blur(rgb @ jnp.array(OPPONENT).T, 1.0))
    tensor = jnp.stack([east * east, east * north, north * north], axis=-1).sum(axis=-2)
    energy = (tensor[..., 0] + tensor[..., 2])[..., None]
    surroundings = blur(energy, rgb.shape[0] / 24)
    return tensor / (energy + noise**2 + texture * surroundings)


def edge_support(tensors: jax.Array, points: jax.Array, normals: jax.Array) -> jax.Array:
    """The support n^T T n (...) at `points` (..., 3) of lines whose planes through the camera have unit `normals` (...,
    3): how strongly the picture has an edge there AND along that line."""
    ee, en, nn = jnp.moveaxis(sample_sphere(tensors, *pixels_from_rays(points, *tensors.shape[:2])), -1, 0)
    x, y, z = jnp.moveaxis(points, -1, 0)
    squared = x * x + y * y
    # The unit tangents are (y, -x, 0) / flat and (-x z, -y z, flat^2) / (flat reach), and n . point = 0.
    east = (normals[..., 0] * y - normals[..., 1] * x) * jax.lax.rsqrt(squared)
    north = normals[..., 2] * jnp.sqrt(1 + z * z / squared)
    return ee * east**2 + 2 * en * east * north + nn * north**2
