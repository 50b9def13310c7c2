"""VACE's control for RGB-alpha video (paper, Sec. 4.2): what stays, what is generated, where, and the context anchor.

    Z = [anchor, 0, 0 | E(foreground), E(background), mask]   in time | channels 16 + 16 + 64

foreground = V M is VACE's inactive stream, background = V (1 - M) its reactive one; M = alpha. The mask says 1 where
pixels are to be generated. Channels are VACE's, so that its published weights load.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

Encode = Callable[[jax.Array], jax.Array]  # video (b, t, h, w, 3) in [-1, 1] -> latents (b, t', h', w', 16)


def signal_of(rgb: jax.Array, alpha: jax.Array) -> jax.Array:
    """Signal in [-1, 1] of sRGB (..., 3) in [0, 1]; mid-grey, its 0, where alpha (...) is 0 and nothing is known."""
    return jnp.where(alpha[..., None] > 0, 2 * rgb - 1, 0.0)


def mask_of(alpha: jax.Array) -> jax.Array:
    """Mask, 1 where a pixel is to be generated: 1 - alpha, cut at 0.5; a pixel of alpha 0.5 stays."""
    return (1 - alpha > 0.5).astype(alpha.dtype)


def streams(signal: jax.Array, mask: jax.Array) -> tuple[jax.Array, jax.Array]:
    """VACE's inactive stream (the paper's foreground) and its reactive one (background), of a signal (..., 3) and a
    mask."""
    return signal * (1 - mask[..., None]), signal * mask[..., None]


def fold_mask(mask: jax.Array, stride: int, frames: int) -> jax.Array:
    """Mask (b, frames, h / stride, w / stride, stride^2) of latents from (b, t, h, w): a latent's pixels, row by row,
    become channels; in time the frame whose centre is nearest, as torch's "nearest-exact"."""
    b, t, h, w = mask.shape
    nearest = ((np.arange(frames) + 0.5) * t / frames).astype(int)
    mask = mask[:, nearest].reshape(b, frames, h // stride, stride, w // stride, stride)
    return mask.transpose(0, 1, 2, 4, 3, 5).reshape(b, frames, h // stride, w // stride, stride**2)


def control_latents(encode: Encode, rgb: jax.Array, alpha: jax.Array, anchor: jax.Array, *, stride: int) -> jax.Array:
    """The control (b, 1 + t', h', w', 96) of clips rgb (b, t, h, w, 3), alpha (b, t, h, w), anchor (b, h, w, 3).

    Colours are sRGB in [0, 1]. The anchor takes the first place in time, with a mask of 0: all of it stays.
    """
    mask = mask_of(alpha)
    # One after the other: the VAE is compiled once, and only one clip's activations live.
    inactive, reactive = jax.lax.map(encode, jnp.stack(streams(signal_of(rgb, alpha), mask)))
    folded = fold_mask(mask, stride, inactive.shape[1]).astype(inactive.dtype)
    video = jnp.concatenate([inactive, reactive, folded], axis=-1)
    first = encode(2 * anchor[:, None] - 1)
    first = jnp.pad(first, ((0, 0),) * 4 + ((0, video.shape[-1] - first.shape[-1]),))
    return jnp.concatenate([first, video], axis=1)
