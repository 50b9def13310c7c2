"""Windows over long trajectories: they overlap, are restored one by one and cross-faded; no frame is dropped.

A clip is lengthened to 1 + 4 n frames by repeating its last and cut back at the end. Windows begin at multiples of 4,
so that a window's latents lie where the whole clip's would: a frame's noise is the same in each window that sees it.
"""

from collections.abc import Callable
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.settings import Settings, setting

STRIDE = 4  # frames a latent


@dataclass(frozen=True)
class WindowConfig(Settings):
    """Windows in which the frames of a trajectory are restored."""

    frames: int = setting(41, "of a window, 1 + 4 n; the paper trains with 41", within="[5, inf)")
    overlap: int = setting(9, "frames shared by neighbouring windows, at least", within="[0, inf)")

    def __post_init__(self):
        super().__post_init__()
        if self.frames % STRIDE != 1:
            raise InputError(f"frames must be 1 + {STRIDE} n, not {self.frames}")
        if self.overlap > self.frames - STRIDE:
            raise InputError(
                f"overlap must be in [0, {self.frames - STRIDE}] for {self.frames} frames, not {self.overlap}"
            )


def padded_length(frames: int) -> int:
    """Smallest 1 + 4 n that holds `frames`."""
    return frames + (1 - frames) % STRIDE


def latent_length(frames: int) -> int:
    """Number of latents of `frames` frames, a last unfilled one counted."""
    return 1 + (padded_length(frames) - 1) // STRIDE


def window_starts(frames: int, config: WindowConfig) -> tuple[int, ...]:
    """Starts of the windows that cover a clip of `padded_length` frames; the last ends with it."""
    step = (config.frames - config.overlap) // STRIDE * STRIDE
    last = max(frames - config.frames, 0)
    return (*range(0, last, step), last)


def window_weights(frames: int, config: WindowConfig) -> np.ndarray:
    """Share (windows, frames) of each window in each frame; shares fade linearly over an overlap and sum to 1."""
    starts = window_starts(frames, config)
    place = np.arange(frames)[None] - np.array(starts)[:, None]
    length = min(config.frames, frames)
    inside = np.minimum(place + 1, length - place).clip(0).astype(float)  # from 1 at an edge, inwards
    return inside / inside.sum(axis=0)


def restore_in_windows(
    restore: Callable[[jax.Array, jax.Array, jax.Array], jax.Array],
    rgb: jax.Array,
    alpha: jax.Array,
    noise: jax.Array,
    config: WindowConfig,
) -> jax.Array:
    """The clip (t, h, w, 3): `restore(rgb, alpha, noise)` of each window, blended.

    rgb (t, h, w, 3), alpha (t, h, w); noise (latent_length(t), h', w', c), the latents' of the whole clip.
    """
    frames = padded_length(rgb.shape[0])
    assert noise.shape[0] == latent_length(rgb.shape[0]), (noise.shape, rgb.shape)
    long_rgb, long_alpha = (_lengthened(x, frames) for x in (rgb, alpha))
    length, total = min(config.frames, frames), jnp.zeros_like(long_rgb)
    for start, weight in zip(window_starts(frames, config), window_weights(frames, config), strict=True):
        part = slice(start, start + length)
        latents = slice(start // STRIDE, start // STRIDE + latent_length(length))
        restored = restore(long_rgb[part], long_alpha[part], noise[latents])
        total = total.at[part].add(restored * weight[part].astype(np.float32)[:, None, None, None])
    return total[: rgb.shape[0]]


def _lengthened(x, frames):
    return jnp.pad(x, ((0, frames - x.shape[0]),) + ((0, 0),) * (x.ndim - 1), mode="edge")
