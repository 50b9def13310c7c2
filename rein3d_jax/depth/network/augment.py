"""Panoramas as other rooms and other cameras would have made them: exact changes (yaw, mirror, a room stretched
along x and y, a tilt), and changes of the picture alone."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp

from rein3d_jax.depth.network.loss import DepthExample
from rein3d_jax.geometry.resample import sample_sphere
from rein3d_jax.geometry.rotations import matrix_from_quats, normalize_quats
from rein3d_jax.geometry.sphere import latitudes, pixel_rays, pixels_from_rays
from rein3d_jax.settings import Settings, setting

_SHARE = "[0, 1]"
_LENS_LIGHT = 0.06  # standard deviation of the log of sRGB between two lenses, halved
_RIM_LIGHT = 0.3  # greatest log of sRGB by which a lens is darker at its rim


@dataclass(frozen=True)
class DepthAugmentConfig(Settings):
    """How far training changes panoramas, and how often."""

    warped: float = setting(0.5, "share that is stretched and tilted", within=_SHARE)
    stretch: float = setting(0.4, "greatest |log| of the factors along x and y", within="[0, 1]")
    tilt: float = setting(1.0, "standard deviation of roll and of pitch", within="[0, 20]", unit="degrees")
    exposure: float = setting(0.5, "standard deviation of the log of all light", within="[0, 2]")
    balance: float = setting(0.12, "standard deviation of the log of each channel's light", within="[0, 1]")
    gamma: float = setting(0.2, "standard deviation of the log of the display's exponent", within="[0, 1]")
    saturation: tuple[float, float] = setting((0.3, 1.4), "least and greatest factor", within="[0, 3]")
    noise: float = setting(0.03, "greatest standard deviation of noise, sRGB", within=_SHARE)
    blurred: float = setting(0.4, "share that is blurred", within=_SHARE)
    tripod: float = setting(0.15, "share with a disc at the nadir", within=_SHARE)
    lenses: float = setting(0.3, "share stitched of two lenses that saw other light", within=_SHARE)


def augment_depth(key: jax.Array, example: DepthExample, config: DepthAugmentConfig) -> DepthExample:
    """One example (h, w) changed at random."""
    warp, which, yaw, flip, tone, disc, lenses = jax.random.split(key, 7)
    example = jax.lax.cond(
        jax.random.bernoulli(which, config.warped), lambda x: _warped(warp, x, config), lambda x: x, example
    )
    columns = jax.random.randint(yaw, (), 0, example.distance.shape[1])
    mirror = jax.random.bernoulli(flip)
    example = jax.tree.map(lambda x: jnp.roll(x, columns, axis=1), example)
    example = jax.tree.map(lambda x: jnp.where(mirror, jnp.flip(x, axis=1), x), example)
    rgb = _of_two_lenses(lenses, toned(tone, example.rgb, config), config)
    return example.replace(rgb=_with_tripod(disc, rgb, config))


def _warped(key: jax.Array, example: DepthExample, config: DepthAugmentConfig) -> DepthExample:
    stretch, lean = jax.random.split(key)
    factors = jnp.exp(jax.random.uniform(stretch, (2,), minval=-config.stretch, maxval=config.stretch))
    halves = jnp.deg2rad(config.tilt) / 2 * jax.random.normal(lean, (2,))  # small angles
    tilt = normalize_quats(jnp.array([1.0, halves[0], halves[1], 0.0]))
    return warped(example, jnp.append(factors, 1.0), matrix_from_quats(tilt))


def warped(example: DepthExample, factors: jax.Array, rotation: jax.Array) -> DepthExample:
    """The room stretched by `factors` (3,) along the world's axes, the last one 1, then rotated by (3, 3).

    A point p = d r moves to R S p. Along a new ray r' it is found at r ~ S^-1 R^T r', at d / |S^-1 R^T r'|."""
    height, width = example.distance.shape
    sources = jnp.matmul(pixel_rays(height, width), rotation, precision="highest") / factors
    length = jnp.linalg.norm(sources, axis=-1)
    u, v = pixels_from_rays(sources, height, width)
    rows = jnp.clip(jnp.floor(v).astype(jnp.int32), 0, height - 1)
    columns = jnp.floor(u).astype(jnp.int32) % width
    return DepthExample(
        sample_sphere(example.rgb, u, v),
        example.distance[rows, columns] / length,  # the nearest: between two surfaces there is nothing
        example.background[rows, columns] / length,
    )


def toned(key: jax.Array, rgb: jax.Array, config: DepthAugmentConfig) -> jax.Array:
    """The picture (h, w, 3) by another camera: light, colour, contrast, sharpness, noise."""
    light, balance, gamma, colour, blur, noise, amount = jax.random.split(key, 7)
    gain = config.exposure * jax.random.normal(light) + config.balance * jax.random.normal(balance, (3,))
    power = jnp.exp(config.gamma * jax.random.normal(gamma))
    rgb = jnp.maximum(rgb, 1e-4) ** power * jnp.exp(gain / 2.2)
    grey = rgb.mean(-1, keepdims=True)
    low, high = config.saturation
    rgb = grey + jax.random.uniform(colour, minval=low, maxval=high) * (rgb - grey)
    share, how_far = jax.random.uniform(blur, (2,))
    rgb = jnp.where(share < config.blurred, rgb + how_far * (_blurred(rgb) - rgb), rgb)
    sigma = config.noise * jax.random.uniform(amount) ** 2
    return jnp.clip(rgb + sigma * jax.random.normal(noise, rgb.shape), 0.0, 1.0)


def _blurred(rgb: jax.Array) -> jax.Array:
    rgb = (jnp.roll(rgb, 1, 1) + 2 * rgb + jnp.roll(rgb, -1, 1)) / 4
    padded = jnp.concatenate([rgb[:1], rgb, rgb[-1:]])
    return (padded[:-2] + 2 * rgb + padded[2:]) / 4


def _of_two_lenses(key: jax.Array, rgb: jax.Array, config: DepthAugmentConfig) -> jax.Array:
    """Two half spheres, of some: each darker towards its rim, one brighter than the other, and a seam between them."""
    there, turn, light, rim, width = jax.random.split(key, 5)
    along = pixel_rays(*rgb.shape[:2]) @ _heading(2 * jnp.pi * jax.random.uniform(turn))  # 1 and -1: the lenses' axes
    softness = jnp.deg2rad(jax.random.uniform(width, minval=0.5, maxval=8.0))
    side = jnp.tanh(along / softness) * _LENS_LIGHT * jax.random.normal(light)
    darker = _RIM_LIGHT * jax.random.uniform(rim) * (1 - jnp.abs(along)) ** 2
    changed = jnp.clip(rgb * jnp.exp(side - darker)[..., None], 0.0, 1.0)
    return jnp.where(jax.random.bernoulli(there, config.lenses), changed, rgb)


def _heading(azimuth: jax.Array) -> jax.Array:
    return jnp.array([jnp.cos(azimuth), jnp.sin(azimuth), 0.0])


def _with_tripod(key: jax.Array, rgb: jax.Array, config: DepthAugmentConfig) -> jax.Array:
    """A disc of one colour at the nadir of some."""
    there, size, colour = jax.random.split(key, 3)
    radius = jnp.deg2rad(jax.random.uniform(size, minval=5.0, maxval=25.0))
    inside = (latitudes(rgb.shape[0]) < radius - jnp.pi / 2) & jax.random.bernoulli(there, config.tripod)
    return jnp.where(inside[:, None, None], jax.random.uniform(colour, (3,)), rgb)
