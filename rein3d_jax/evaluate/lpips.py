"""LPIPS, the learned perceptual distance of two images (Zhang et al. 2018), version 0.1 with AlexNet. 0 is best."""

from collections.abc import Mapping

import jax
import jax.numpy as jnp

from rein3d_jax.evaluate.alexnet import alexnet
from rein3d_jax.geometry.safe import safe_norm

_EPSILON = 1e-10  # the authors' code, beside the paper's equation


@jax.jit
def lpips(params: Mapping[str, jax.Array], image: jax.Array, reference: jax.Array) -> jax.Array:
    """LPIPS (...) of images (..., h, w, 3), sRGB in [0, 1], h and w at least 31. `params` are those of
    `io.weights.metric_weights.lpips_weights`.

    d = sum over layers l of mean over pixels of sum over channels w_l (y_l - y0_l)^2, y of unit length (eq. 1).
    """
    assert image.shape == reference.shape, (image.shape, reference.shape)
    both = jnp.stack([image, reference]).reshape(-1, *image.shape[-3:])
    total = 0.0
    for i, layer in enumerate(alexnet(params, both)):
        unit = layer / (safe_norm(layer)[..., None] + _EPSILON)
        left, right = jnp.split(unit, 2)
        total += jnp.mean(jnp.sum(params[f"head{i}"] * (left - right) ** 2, axis=-1), axis=(-2, -1))
    return total.reshape(image.shape[:-3])
