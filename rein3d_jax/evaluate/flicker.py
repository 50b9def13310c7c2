"""How much a video trembles, the motion of its camera included."""

import jax
import jax.numpy as jnp


@jax.jit
def flicker(frames: jax.Array) -> jax.Array:
    """RMS () of the independent noise that would make a still video tremble as much: the RMS difference of neighbouring
    `frames` (t, h, w, c), sRGB in [0, 1], t >= 2, over sqrt(2), since both carry the noise. Every pixel counts the
    same."""
    return jnp.sqrt(jnp.mean(jnp.diff(frames, axis=0) ** 2) / 2)
