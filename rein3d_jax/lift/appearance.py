"""Solid where it is plain, sharp where it is not: how far splats overlap, and the colours that they need so that their
picture is the photo.

One splat a pixel that is wide enough to close every gap blurs; one that is sharp lets some per cent of what is behind
it through, in a weave. The weave shows on plain surfaces, the blur on detailed ones: plain pixels get wide splats and
the others narrow ones. What splats blur all the same is put into their colours before: a filter of the picture, not
the colours that best explain it from the origin. Those depend on the order of compositing there, and bring the truth
elsewhere no nearer (benchmarks/README.md)."""

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.morphology import window_sum
from rein3d_jax.geometry.resample import pad_sphere

_PLAIN = 0.02  # of sRGB's range: rms of what is no gradient, above which the eye sees texture and no weave
_BLUR = 0.8  # pixels, sigma: what a splat, a pixel's filter and the photo's own softness do together
_RADIUS = 2  # pixels: of that blur


def splat_overlap(rgb: jax.Array, *, detailed: float, plain: float) -> jax.Array:
    """Sigma over half a pixel's diagonal (h, w): `plain` where the picture (h, w, 3) has no detail, `detailed`
    where it has. Beside steps of distance as elsewhere: narrow splats there bring nothing nearer, and weave."""
    detail = rgb - window_sum(rgb, 1) / 9
    power = window_sum(jnp.sum(detail**2, axis=-1), 1) / 9
    return detailed + (plain - detailed) * jnp.exp(-power / _PLAIN**2)


def sharpened(rgb: jax.Array, amount: float) -> jax.Array:
    """The picture (h, w, 3) plus `amount` of what a splat blurs away, in [0, 1]."""
    offsets = jnp.arange(-_RADIUS, _RADIUS + 1)
    weights = jnp.exp(-0.5 * (offsets / _BLUR) ** 2)
    weights /= weights.sum()
    padded = pad_sphere(rgb, _RADIUS)
    rows = sum(w * padded[i : i + rgb.shape[0]] for i, w in enumerate(weights))
    blurred = sum(w * rows[:, i : i + rgb.shape[1]] for i, w in enumerate(weights))
    return jnp.clip(rgb + amount * (rgb - blurred), 0, 1)
