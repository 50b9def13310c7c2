"""The backbone computes what EfficientNet-Lite0 does: against a plain one written with XLA's own convolutions."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.depth.network.backbone import Backbone
from rein3d_jax.depth.network.config import KERNELS, STRIDES, DepthNetworkConfig

CONFIG = DepthNetworkConfig(stem=8, channels=(4, 6, 8, 10, 12, 14, 16), blocks=(1, 2, 1, 1, 2, 1, 1), expand=3)


def convolved(grid, kernel, stride, groups=1):
    """XLA's "SAME" over the rows, a circle over the columns."""
    size = kernel.shape[0]
    before = (size - stride) // 2
    after = size - stride - before
    wide = jnp.pad(grid, ((0, 0), (0, 0), (before, after), (0, 0)), mode="wrap")
    return jax.lax.conv_general_dilated(
        wide, kernel, (stride, stride), ((before, after), (0, 0)),
        dimension_numbers=("NHWC", "HWIO", "NHWC"), feature_group_count=groups,
    )  # fmt: skip


def plain(parameters, rgb):
    """Tan and Le 2019, Table 1, with ReLU6 and without squeeze-and-excitation."""

    def cut(x):
        return jnp.clip(x, 0, 6)

    stem = parameters["stem"]
    grid, number = cut(convolved((rgb * 255 - 127) / 128, stem["kernel"], 2) + stem["bias"]), 0
    for stage, count in enumerate(CONFIG.blocks):
        for block in range(count):
            leaves, hidden = parameters[f"block{number:02}"], grid
            if stage:
                hidden = cut(hidden @ leaves["expand"]["kernel"] + leaves["expand"]["bias"])
            kernel = leaves["depthwise"]["kernel"][:, :, None]
            assert kernel.shape[0] == KERNELS[stage]
            hidden = convolved(hidden, kernel, 1 if block else STRIDES[stage], hidden.shape[-1])
            hidden = cut(hidden + leaves["depthwise"]["bias"]) @ leaves["project"]["kernel"] + leaves["project"]["bias"]
            grid, number = (grid + hidden if block else hidden), number + 1
    return grid


@pytest.fixture(scope="module")
def parameters():
    rgb = jnp.zeros((1, 32, 64, 3))
    return jax.jit(lambda key: Backbone(CONFIG).init(key, rgb)["params"])(jax.random.key(1))


def test_it_is_the_plain_one(parameters):
    rgb = jax.random.uniform(jax.random.key(0), (1, 64, 128, 3))
    parameters = jax.tree.map(lambda x: np.asarray(x) + np.float32(0.1), parameters)  # biases that are not 0
    features = jax.jit(lambda parameters, rgb: Backbone(CONFIG).apply({"params": parameters}, rgb))(parameters, rgb)
    assert [x.shape[1] for x in features] == [32, 16, 8, 4, 2]
    expected = jax.jit(plain)(parameters, rgb)
    np.testing.assert_allclose(features[-1], expected, atol=1e-4 * float(jnp.abs(expected).max()))


def test_no_gradient_reaches_what_is_frozen(parameters):
    rgb = jax.random.uniform(jax.random.key(0), (1, 32, 64, 3))

    def loss(parameters):
        return sum(jnp.sum(x**2) for x in Backbone(CONFIG, frozen=2).apply({"params": parameters}, rgb))

    slopes = jax.jit(jax.grad(loss))(parameters)
    still = {name for name, slope in slopes.items() if not any(x.any() for x in jax.tree.leaves(slope))}
    assert still == {"stem", "block00", "block01", "block02"}
    assert not any(slopes[name]["depthwise"]["kernel"].any() for name in slopes if name != "stem")
