"""How far a DepthPrediction is from the truth. All means are over the sphere's area, where the truth is known."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.depth.network.network import DepthPrediction
from rein3d_jax.geometry.sphere import latitudes, pixel_rays
from rein3d_jax.settings import Settings, setting

_WEIGHT = "[0, inf)"


@struct.dataclass
class DepthExample:
    """A panorama and its truth, over the camera's height; with leading axes, several."""

    rgb: jax.Array  # (..., h, w, 3) sRGB in [0, 1]
    distance: jax.Array  # (..., h, w) along the ray; 0 = has none
    background: jax.Array  # (..., h, w) of the empty room; 0 = not known


@dataclass(frozen=True)
class DepthLossConfig(Settings):
    """Weights of what training minimises, beside the mean |error of log distance|, which has 1."""

    background: float = setting(0.5, "mean |error of the background's log distance|", within=_WEIGHT)
    gradients: float = setting(0.5, "mean |difference of neighbours' errors|, at each scale", within=_WEIGHT)
    scales: int = setting(3, "of the gradients: strides 1, 2, 4 ...", within="[1, 6]")
    normals: float = setting(0.05, "1 - cosine between the surfaces' normals", within=_WEIGHT)
    likelihood: float = setting(0.1, "negative log likelihood of the error under the predicted scale", within=_WEIGHT)
    unknown: float = setting(0.1, "cross entropy of what has no distance", within=_WEIGHT)


def depth_loss(
    predicted: DepthPrediction, example: DepthExample, config: DepthLossConfig
) -> tuple[jax.Array, jax.Array]:
    """Sum of penalties over the panoramas (n, h, w), and their number."""
    known = (example.distance > 0).astype(jnp.float32)
    area = jnp.cos(latitudes(known.shape[1]))[:, None] * jnp.ones_like(known)
    true = _log(example.distance)
    error = predicted.log_distance - true
    penalty = _mean(jnp.abs(error), area * known)
    off = jnp.abs(predicted.log_background - _log(example.background))
    penalty += config.background * _mean(off, area * (example.background > 0))
    penalty += config.gradients * gradient_penalty(error, area * known, config.scales)
    penalty += config.normals * _mean(*_normal_penalty(predicted.log_distance, true, area * known))
    # The scale learns from the error; the distance does not learn to be right where it is easy.
    scale = predicted.log_scale
    penalty += config.likelihood * _mean(jax.lax.stop_gradient(jnp.abs(error)) * jnp.exp(-scale) + scale, area * known)
    penalty += config.unknown * _mean(_cross_entropy(predicted.unknown, 1 - known), area)
    return penalty.sum(), jnp.float32(len(known))


def gradient_penalty(error: jax.Array, weight: jax.Array, scales: int) -> jax.Array:
    """Mean |difference| (n,) of the errors (n, h, w) of pixels 1, 2, 4 ... apart, summed over the scales."""
    total = 0.0
    for scale in range(scales):
        step = 2**scale
        e, w = error[:, ::step, ::step], weight[:, ::step, ::step]
        across, both = jnp.abs(jnp.roll(e, -1, 2) - e), jnp.minimum(jnp.roll(w, -1, 2), w)
        total += _mean(across, both) + _mean(jnp.abs(e[:, 1:] - e[:, :-1]), jnp.minimum(w[:, 1:], w[:, :-1]))
    return total


def _normal_penalty(log_distance: jax.Array, true: jax.Array, weight: jax.Array) -> tuple[jax.Array, jax.Array]:
    """1 - cosine of the angle between the normals of two point maps (n, h, w), and its weight: where the true surface
    is one, seen not too aslant."""
    ours, _ = _normals(log_distance)
    theirs, facing = _normals(true)
    cosine = jnp.sum(ours * theirs, axis=-1)
    whole = jnp.minimum(weight, jnp.roll(weight, -1, 2))[:, :-1] * (weight[:, 1:] > 0)
    return 1 - cosine, whole * (facing > 0.2)


def _normals(log_distance: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Unit normals (n, h - 1, w, 3) of the point map, and how far they face the camera, in [-1, 1]."""
    rays = pixel_rays(*log_distance.shape[1:])
    points = jnp.exp(log_distance)[..., None] * rays
    right, down = (jnp.roll(points, -1, 2) - points)[:, :-1], points[:, 1:] - points[:, :-1]
    normal = jnp.cross(right, down)
    normal = normal / jnp.sqrt(jnp.sum(normal**2, axis=-1, keepdims=True) + 1e-12)
    return normal, jnp.abs(jnp.sum(normal * rays[:-1], axis=-1))


def _log(distance: jax.Array) -> jax.Array:
    return jnp.log(jnp.where(distance > 0, distance, 1.0))


def _mean(values: jax.Array, weight: jax.Array) -> jax.Array:
    return jnp.sum(values * weight, axis=(1, 2)) / jnp.maximum(jnp.sum(weight, axis=(1, 2)), 1e-6)


def _cross_entropy(logit: jax.Array, label: jax.Array) -> jax.Array:
    return jnp.logaddexp(0.0, logit) - label * logit
