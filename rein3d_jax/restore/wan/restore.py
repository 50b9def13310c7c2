"""Degraded RGB-alpha clip -> clean clip with the full-size network: encode, condition, sample, decode."""

from dataclasses import dataclass, field
from typing import Any

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.errors import InputError
from rein3d_jax.restore.background import Background, restore_background
from rein3d_jax.restore.blend import blend
from rein3d_jax.restore.noise import draw_noise, require_kind
from rein3d_jax.restore.wan.condition import control_latents
from rein3d_jax.restore.wan.config import WanConfig
from rein3d_jax.restore.wan.dit import Dit
from rein3d_jax.restore.wan.sampler import guided, sample
from rein3d_jax.restore.wan.schedule import sampling_sigmas
from rein3d_jax.restore.wan.solver import SOLVERS
from rein3d_jax.restore.wan.vae import LATENT, Vae
from rein3d_jax.restore.wan.windows import WindowConfig, latent_length, restore_in_windows
from rein3d_jax.scene import Video


@dataclass(frozen=True)
class SampleConfig:
    steps: int = 50  # Wan's own default, as are the next two
    shift: float = 3.0
    guidance: float = 5.0  # 1 for one pass a step, without guidance
    solver: str = "unipc"  # unipc | euler
    noise: str = "latitude"  # latitude | white | paper
    turn: bool = True  # turn the panorama at random from step to step, for a network whose RoPE is not circular
    windows: WindowConfig = field(default_factory=WindowConfig)

    def __post_init__(self):
        if self.steps < 1:
            raise InputError(f"sample.steps {self.steps} must be at least 1")
        if self.solver not in SOLVERS:
            raise InputError(f'sample.solver "{self.solver}" is unknown; choose one of {", ".join(SOLVERS)}')
        require_kind("sample.noise", self.noise)


@struct.dataclass
class WanParams:
    """Parameters of `Dit` and `Vae`, and the text the network is given: fixed, for rooms need no words."""

    dit: Any
    vae: Any
    text: jax.Array  # (m, text_dim) embedded prompt, zeros after its end
    no_text: jax.Array  # the same for the negative prompt; used if guidance is not 1


def restore_video(
    video: Video,
    key: jax.Array,
    *,
    params: WanParams,
    config: WanConfig,
    sampling: SampleConfig,
    observed: float,
    background: Background | None = None,
) -> Video:
    """A restorer once all keywords are bound. The context anchor is frame 0, which stands at the world's origin.

    What was observed (alpha near 1) returns as it was, guesses take its colours. The network knows no distance: holes
    take the background fill's. Raises InputError unless tokens fill a frame (multiples of 16 pixels).
    """
    require_size(*video.alpha.shape[1:], config)
    key_noise, key_turn = jax.random.split(key)
    noise = clip_noise(key_noise, video.alpha.shape, config, sampling.noise)
    drawn = restore_frames(
        key_turn, params, video.rgb, video.alpha, video.rgb[0], noise, config=config, sampling=sampling
    )
    filled = restore_background(video, observed=observed, background=background)
    return filled.replace(rgb=blend(drawn, video.rgb, video.alpha, observed=observed))


def clip_noise(key: jax.Array, shape: tuple[int, int, int], config: WanConfig, kind: str) -> jax.Array:
    """(1 + latents, h', w', 16) for a clip of `shape` (t, h, w) pixels; the anchor's comes first."""
    frames, height, width = shape
    size = (1 + latent_length(frames), height // config.vae.stride, width // config.vae.stride, LATENT)
    return draw_noise(key, size, kind=kind)


def restore_frames(
    key: jax.Array,
    params: WanParams,
    rgb: jax.Array,
    alpha: jax.Array,
    anchor: jax.Array,
    noise: jax.Array,
    *,
    config: WanConfig,
    sampling: SampleConfig,
) -> jax.Array:
    """Clean sRGB (t, h, w, 3), every pixel the network's, of a degraded clip rgb (t, h, w, 3), alpha (t, h, w), any t.

    anchor (h, w, 3) is the panorama at the world's origin, noise that of `clip_noise`; the key turns the panorama
    between steps.
    """
    turn_by = config.dit.patch[2] if sampling.turn else 0

    def restore(part_rgb, part_alpha, part_noise):
        part = (part_rgb, part_alpha, anchor, jnp.concatenate([noise[:1], part_noise]))
        return _restore_clip(key, params, *part, config=config, sampling=sampling, turn_by=turn_by)

    return restore_in_windows(restore, rgb, alpha, noise[1:], sampling.windows)


def require_size(height: int, width: int, config: WanConfig) -> None:
    """Raises InputError unless tokens fill a panorama of `height` x `width` pixels."""
    steps = [config.vae.stride * side for side in config.dit.patch[1:]]
    if height % steps[0] or width % steps[1]:
        raise InputError(f"{height} x {width} pixels do not fill whole tokens: take multiples of {steps[0]}")


def clip_velocity(params: WanParams, config: WanConfig, guidance: float):
    """The network as the sampler sees it: (x, control, timestep) -> velocity, guided."""

    def under(text):
        def velocity(x, control, timestep):
            timesteps = jnp.full(len(x), timestep, jnp.float32)
            texts = jnp.broadcast_to(text, (len(x), *text.shape))
            return Dit(config.dit).apply({"params": params.dit}, x, timesteps, texts, control)

        return velocity

    return guided(under(params.text), under(params.no_text), guidance)


def _restore(key, params, rgb, alpha, anchor, noise, *, config, sampling, turn_by):
    vae = Vae(config.vae)

    def encode(video):
        return vae.apply({"params": params.vae}, video, method="encode")

    control = control_latents(encode, rgb[None], alpha[None], anchor[None], stride=config.vae.stride)
    solver = SOLVERS[sampling.solver](sampling_sigmas(sampling.steps, sampling.shift))
    velocity = clip_velocity(params, config, sampling.guidance)
    latents = sample(key, velocity, noise[None], control, solver, turn_by=turn_by)
    video = vae.apply({"params": params.vae}, latents[:, 1:], method="decode")
    return (video[0] + 1) / 2


_restore_clip = jax.jit(_restore, static_argnames=("config", "sampling", "turn_by"))
