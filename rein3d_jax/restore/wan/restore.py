"""The full-size network as a restorer: a degraded RGB-alpha clip is encoded, conditions the sampler, and is decoded."""

from dataclasses import dataclass
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.errors import InputError
from rein3d_jax.restore.background import Background, restore_background
from rein3d_jax.restore.blend import blend
from rein3d_jax.restore.noise import NOISES, draw_noise
from rein3d_jax.restore.wan.condition import control_latents
from rein3d_jax.restore.wan.config import WanConfig
from rein3d_jax.restore.wan.dit import Dit
from rein3d_jax.restore.wan.lora_names import LoraFileConfig
from rein3d_jax.restore.wan.sampler import guided, sample_latents
from rein3d_jax.restore.wan.schedule import sampling_sigmas
from rein3d_jax.restore.wan.solver import SOLVERS
from rein3d_jax.restore.wan.vae import LATENT, Vae
from rein3d_jax.restore.wan.windows import WindowConfig, latent_length, restore_in_windows
from rein3d_jax.scene import Video
from rein3d_jax.settings import Settings, setting


@dataclass(frozen=True)
class SampleConfig(Settings):
    """How a clip is drawn from the full-size network; steps, shift and guidance are Wan's own."""

    steps: int = setting(50, "of the sampler", within="[1, inf)")
    shift: float = setting(3.0, "of the schedule towards high noise, for large pictures", within="(0, inf)")
    guidance: float = setting(5.0, "classifier-free; 1: one pass a step, without it", within="(-inf, inf)")
    solver: str = setting("unipc", "of the flow's ODE", among=tuple(SOLVERS))
    noise: str = setting("latitude", "correlated as pixels crowd, white, or the paper's warp", among=tuple(NOISES))
    words: bool = setting(True, "give the network the prompts of text/; false: none, for which guidance must be 1")
    random_yaw: bool = setting(True, "yaw the panorama at random from step to step, for a RoPE that is not circular")
    windows: WindowConfig = WindowConfig()

    def __post_init__(self):
        super().__post_init__()
        if not self.words and self.guidance != 1:
            raise InputError(f"guidance must be 1 without words, which guide it, not {self.guidance}")


@dataclass(frozen=True)
class DiffusionConfig(Settings):
    """The full-size network, and how clips are drawn from it."""

    network: WanConfig = WanConfig()
    sample: SampleConfig = SampleConfig()
    lora: LoraFileConfig = LoraFileConfig()


@struct.dataclass
class WanParams:
    """Parameters of `Dit` and `Vae`, and the text the network is given: fixed, for rooms need no words."""

    dit: Any
    vae: Any
    text: jax.Array  # (m, text_dim) embedded prompt, zeros after its end; without words (1, text_dim) zeros
    no_text: jax.Array  # the same for the negative prompt; used if guidance is not 1


@struct.dataclass
class DegradedClip:
    """A clip as the network is given it, and the context anchor: the panorama at the world's origin. sRGB in [0, 1]."""

    rgb: jax.Array  # (t, h, w, 3)
    alpha: jax.Array  # (t, h, w) 1 = observed
    anchor: jax.Array  # (h, w, 3)


def restore_video(
    video: Video,
    key: jax.Array,
    *,
    params: WanParams,
    config: DiffusionConfig,
    observed: float,
    background: Background | None = None,
) -> Video:
    """The restored video: a restorer once all keywords are bound. The anchor is frame 0, at the world's origin.

    What was observed (alpha near 1) returns as it was, guesses take its colours. The network gives no distance: holes
    take the background fill's. Raises InputError unless tokens fill a frame (multiples of 16 pixels).
    """
    require_size(*video.alpha.shape[1:], config.network)
    key_noise, key_yaw = jax.random.split(key)
    noise = clip_noise(key_noise, video.alpha.shape, config)
    drawn = restore_frames(key_yaw, params, DegradedClip(video.rgb, video.alpha, video.rgb[0]), noise, config)
    filled = restore_background(video, observed=observed, background=background)
    return filled.replace(rgb=blend(drawn, video.rgb, video.alpha, observed=observed))


def clip_noise(key: jax.Array, shape: tuple[int, int, int], config: DiffusionConfig) -> jax.Array:
    """Noise (1 + latents, h', w', 16) for a clip of `shape` (t, h, w) pixels; the anchor's comes first."""
    (frames, height, width), stride = shape, config.network.vae.stride
    size = (1 + latent_length(frames), height // stride, width // stride, LATENT)
    return draw_noise(key, size, kind=config.sample.noise)


def restore_frames(
    key: jax.Array, params: WanParams, clip: DegradedClip, noise: jax.Array, config: DiffusionConfig
) -> jax.Array:
    """Clean sRGB (t, h, w, 3), every pixel the network's, of a clip of any length; noise is that of `clip_noise`, the
    key yaws the panorama between steps."""

    def restore(rgb, alpha, part_noise):
        part = DegradedClip(rgb, alpha, clip.anchor)
        return _restore_window(key, params, part, jnp.concatenate([noise[:1], part_noise]), config)

    return restore_in_windows(restore, clip.rgb, clip.alpha, noise[1:], config.sample.windows)


def require_size(height: int, width: int, config: WanConfig) -> None:
    """Raises InputError unless tokens fill a panorama of `height` x `width` pixels."""
    steps = [config.vae.stride * side for side in config.dit.patch[1:]]
    if height % steps[0] or width % steps[1]:
        raise InputError(f"{height} x {width} pixels do not fill whole tokens: take multiples of {steps[0]}")


def clip_velocity(params: WanParams, config: WanConfig, guidance: float):
    """Velocity (x, control, timestep) of the network under its text, guided, as the sampler takes it."""

    def under(text):
        def velocity(x, control, timestep):
            timesteps = jnp.full(len(x), timestep, jnp.float32)
            texts = jnp.broadcast_to(text, (len(x), *text.shape))
            return Dit(config.dit).apply({"params": params.dit}, x, timesteps, texts, control)

        return velocity

    return guided(under(params.text), under(params.no_text), guidance)


@partial(jax.jit, static_argnames="config")
def _restore_window(key, params: WanParams, clip: DegradedClip, noise, config: DiffusionConfig):
    network, sampling = config.network, config.sample
    vae = Vae(network.vae)

    def encode(video):
        return vae.apply({"params": params.vae}, video, method="encode")

    given = (clip.rgb[None], clip.alpha[None], clip.anchor[None])
    control = control_latents(encode, *given, stride=network.vae.stride)
    solver = SOLVERS[sampling.solver](sampling_sigmas(sampling.steps, sampling.shift))
    velocity = clip_velocity(params, network, sampling.guidance)
    yaw_step = network.dit.patch[2] if sampling.random_yaw else 0
    latents = sample_latents(key, velocity, noise[None], control, solver, yaw_step=yaw_step)
    video = vae.apply({"params": params.vae}, latents[:, 1:], method="decode")
    return (video[0] + 1) / 2
