"""The full-size network's objective (paper, Sec. 4.2 (2)): the velocity of a straight path, weighed by area.

    x_s = (1 - s) x_0 + s e,     loss = sum W(latitude) |v(x_s, 1000 s) - (e - x_0)|^2 / sum W

The context anchor stands first in time, as in sampling; it is given, so its weight is 0. e is the noise that sampling
starts from, s is distributed as sampling's steps are. Text is dropped: each clip is trained under the same words.
"""

from collections.abc import Callable
from dataclasses import dataclass

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.geometry.sphere import latitudes
from rein3d_jax.restore.noise import NOISES, draw_noise
from rein3d_jax.restore.wan.condition import Encode, control_latents
from rein3d_jax.restore.wan.schedule import TIMESTEPS, noised, shifted, velocity_of
from rein3d_jax.settings import Settings, setting

Predict = Callable[[jax.Array, jax.Array, jax.Array], jax.Array]  # (x, timestep (b,), control) -> velocity


@dataclass(frozen=True)
class ObjectiveConfig(Settings):
    """What the full-size network is trained for."""

    latitude: float = setting(0.1, "weight left at the poles, lambda + (1 - lambda) cos(latitude)", within="[0, 1]")
    shift: float = setting(3.0, "of the noise levels towards high noise, as sampling's", within="(0, inf)")
    noise: str = setting("latitude", "correlated as pixels crowd, white, or the paper's warp", among=tuple(NOISES))


@struct.dataclass
class FlowTarget:
    """Clean latents and the control of clips, the anchor first in time."""

    clean: jax.Array  # (b, 1 + t', h', w', 16) latents
    control: jax.Array  # (b, 1 + t', h', w', 96)


def flow_target(encode: Encode, clean: jax.Array, rgb: jax.Array, alpha: jax.Array, *, stride: int) -> FlowTarget:
    """Target of clean clips (b, t, h, w, 3) and their degraded rgb (b, t, h, w, 3), alpha (b, t, h, w); the anchor is
    the clean frame 0, at the world's origin. Nothing in here is differentiated."""
    control, latents = control_latents(encode, rgb, alpha, clean[:, 0], stride=stride), encode(2 * clean - 1)
    anchor = control[:, :1, ..., : latents.shape[-1]]
    return jax.lax.stop_gradient(FlowTarget(jnp.concatenate([anchor, latents], axis=1), control))


def flow_loss(
    predict: Predict, target: FlowTarget, keys: jax.Array, config: ObjectiveConfig
) -> tuple[jax.Array, jax.Array]:
    """Weighted sum of squared errors and sum of weights of clips, each with a key (b,) of its own: divide once both are
    summed over the whole batch, and a batch in parts has the gradient of the whole."""
    noise, sigma = jax.vmap(lambda key, clean: _draw(key, clean.shape, config))(keys, target.clean)
    x = noised(target.clean, noise, sigma[:, None, None, None, None])
    error = predict(x, TIMESTEPS * sigma, target.control) - velocity_of(target.clean, noise)
    weights = jnp.broadcast_to(latent_weights(*error.shape[1:3], config.latitude), error.shape[:-1])
    return jnp.sum(weights * jnp.mean(error**2, axis=-1)), jnp.sum(weights)


def latent_weights(frames: int, height: int, latitude: float) -> jax.Array:
    """Weights (frames, height, 1): W of each latent row, and 0 for the anchor, frame 0."""
    rows = latitude + (1 - latitude) * jnp.cos(latitudes(height))
    return (jnp.arange(frames) > 0)[:, None, None] * rows[:, None]


def _draw(key, shape, config):
    key_noise, key_sigma = jax.random.split(key)
    sigma = shifted(jax.random.uniform(key_sigma), config.shift)
    return draw_noise(key_noise, shape, kind=config.noise), sigma
