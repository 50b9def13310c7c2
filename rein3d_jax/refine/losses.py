"""L1 + 0.2 D-SSIM, weighted by the trust in each pixel (3DGS eq. 7; paper Sec. 3.3)."""

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.structural_similarity import WINDOW, ssim_map


def photometric_loss(image: jax.Array, target: jax.Array, weight: jax.Array, *, ssim_weight: float) -> jax.Array:
    """(h, w, 3), (h, w, 3), (h, w) -> (): mean of weight x ((1 - s) |image - target| + s (1 - SSIM)).

    Not divided by the sum of weights: a view of guesses shall pull less than a view of observations.
    """
    # What has no weight shows the image itself: no window straddles something unknown, and its value may be anything.
    known = jnp.where(weight[..., None] > 0, target, jax.lax.stop_gradient(image))
    absolute = jnp.mean(weight * jnp.mean(jnp.abs(image - known), axis=-1))
    rim = WINDOW // 2
    inner = weight[rim:-rim, rim:-rim]
    dissimilar = jnp.mean(inner * jnp.mean(1 - ssim_map(image, known), axis=-1))
    return (1 - ssim_weight) * absolute + ssim_weight * dissimilar
