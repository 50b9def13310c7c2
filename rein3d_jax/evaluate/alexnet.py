"""AlexNet's five rectified convolutions (Krizhevsky 2014, as in torchvision), the backbone of LPIPS.

Parameters are `io.weights.metric_weights.lpips_weights`: kernel0..4 (height, width, in, out) and bias0..4 (out,)."""

from collections.abc import Mapping

import jax
import jax.numpy as jnp

_STRIDES, _PADS = (4, 1, 1, 1, 1), (2, 2, 1, 1, 1)
_POOLED = (1, 2)  # the convolutions that a 3 x 3 maximum, every second pixel, comes before
_SHIFT, _SCALE = (-0.030, -0.088, -0.188), (0.458, 0.448, 0.450)  # LPIPS 0.1's, of images in [-1, 1]
_MIN_SIZE = 31  # pixels: smaller leaves nothing for the last convolutions


def alexnet(params: Mapping[str, jax.Array], images: jax.Array) -> list[jax.Array]:
    """Five layers (n, h', w', channels), h' about h / 4, h / 8, and h / 16 thrice, of (n, h, w, 3) sRGB in [0, 1]."""
    assert images.ndim == 4 and min(images.shape[1:3]) >= _MIN_SIZE, images.shape
    x = (2 * images - 1 - jnp.array(_SHIFT)) / jnp.array(_SCALE)
    layers = []
    for i, (stride, pad) in enumerate(zip(_STRIDES, _PADS, strict=True)):
        x = _largest_of_nine(x) if i in _POOLED else x
        x = jax.nn.relu(_convolve(x, params[f"kernel{i}"], stride, pad) + params[f"bias{i}"])
        layers.append(x)
    return layers


def _convolve(x: jax.Array, kernel: jax.Array, stride: int, pad: int) -> jax.Array:
    return jax.lax.conv_general_dilated(
        x,
        kernel,
        (stride, stride),
        [(pad, pad), (pad, pad)],
        dimension_numbers=("NHWC", "HWIO", "NHWC"),
        precision=jax.lax.Precision.HIGHEST,  # a metric must not depend on the accelerator
    )


def _largest_of_nine(x: jax.Array) -> jax.Array:
    return jax.lax.reduce_window(x, -jnp.inf, jax.lax.max, (1, 3, 3, 1), (1, 2, 2, 1), "VALID")
