"""Inflated 3D Inception (Carreira and Zisserman 2017), trained on Kinetics-400: the network whose logits FVD compares.

Parameters are those of `io.weights.metric_weights.i3d_weights`: `UNIT.kernel` (frames, height, width, in, out) and
`UNIT.bias` (out,), batch normalisation folded in."""

from collections.abc import Mapping

import jax
import jax.numpy as jnp

Params = Mapping[str, jax.Array]
SIDE = 224  # pixels, what it was trained on
MIN_FRAMES = 9  # frames: the last average is over two of every eight


def i3d(params: Params, videos: jax.Array) -> jax.Array:
    """Logits (n, 400), averaged over time, of videos (n, t, 224, 224, 3), sRGB in [0, 1], t >= 9."""
    assert videos.shape[2:] == (SIDE, SIDE, 3) and videos.shape[1] >= MIN_FRAMES, videos.shape
    x = _unit(params, "Conv3d_1a_7x7", 2 * videos - 1, stride=2)
    x = _largest(x, (1, 3, 3), (1, 2, 2))
    x = _unit(params, "Conv3d_2c_3x3", _unit(params, "Conv3d_2b_1x1", x))
    x = _inception(params, ("3b", "3c"), _largest(x, (1, 3, 3), (1, 2, 2)))
    x = _inception(params, ("4b", "4c", "4d", "4e", "4f"), _largest(x, (3, 3, 3), (2, 2, 2)))
    x = _inception(params, ("5b", "5c"), _largest(x, (2, 2, 2), (2, 2, 2)))
    x = jax.lax.reduce_window(x, 0.0, jax.lax.add, (1, 2, 7, 7, 1), (1, 1, 1, 1, 1), "VALID") / (2 * 7 * 7)
    return jnp.mean(_linear(params, "Logits/Conv3d_0c_1x1", x), axis=(1, 2, 3))


def _inception(params: Params, names: tuple[str, ...], x: jax.Array) -> jax.Array:
    """Modules in a row, each of four branches side by side: 1x1; 1x1, 3x3; 1x1, 3x3; maximum, 1x1."""
    for name in names:
        unit = f"Mixed_{name}.Branch_"
        one = _unit(params, f"{unit}0/Conv3d_0a_1x1", x)
        two = _unit(params, f"{unit}1/Conv3d_0b_3x3", _unit(params, f"{unit}1/Conv3d_0a_1x1", x))
        three = _unit(params, f"{unit}2/Conv3d_0b_3x3", _unit(params, f"{unit}2/Conv3d_0a_1x1", x))
        four = _unit(params, f"{unit}3/Conv3d_0b_1x1", _largest(x, (3, 3, 3), (1, 1, 1)))
        x = jnp.concatenate([one, two, three, four], axis=-1)
    return x


def _unit(params: Params, name: str, x: jax.Array, *, stride: int = 1) -> jax.Array:
    return jax.nn.relu(_linear(params, name, x, stride=stride))


def _linear(params: Params, name: str, x: jax.Array, *, stride: int = 1) -> jax.Array:
    convolved = jax.lax.conv_general_dilated(
        x,
        params[f"{name}.kernel"],
        (stride,) * 3,
        "SAME",
        dimension_numbers=("NDHWC", "DHWIO", "NDHWC"),
        precision=jax.lax.Precision.HIGHEST,  # a metric must not depend on the accelerator
    )
    return convolved + params[f"{name}.bias"]


def _largest(x: jax.Array, window: tuple[int, ...], strides: tuple[int, ...]) -> jax.Array:
    return jax.lax.reduce_window(x, -jnp.inf, jax.lax.max, (1, *window, 1), (1, *strides, 1), "SAME")
