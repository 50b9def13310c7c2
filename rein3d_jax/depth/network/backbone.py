"""EfficientNet-Lite0 (Tan and Le 2019; without squeeze-and-excitation, ReLU6) without its head, seamless across the
azimuth. Batch norms are folded into the convolutions."""

import flax.linen as nn
import jax

from rein3d_jax.depth.network.config import KERNELS, STRIDES, DepthNetworkConfig
from rein3d_jax.depth.network.convolution import Depthwise, convolve

_MEAN, _SCALE = 127 / 255, 255 / 128  # of the pictures that its weights were trained on


class Stem(nn.Module):
    """3 x 3 convolution of stride 2 with a bias."""

    features: int

    @nn.compact
    def __call__(self, grid: jax.Array) -> jax.Array:
        shape = (3, 3, grid.shape[-1], self.features)
        kernel = self.param("kernel", nn.initializers.he_normal(), shape)
        return convolve(grid, kernel, 2) + self.param("bias", nn.initializers.zeros, shape[-1:])


class InvertedBlock(nn.Module):
    """Expand, convolve each channel, project; added to its input where the shapes agree."""

    features: int
    expand: int
    kernel: int
    stride: int
    frozen: bool = False  # the depthwise kernel

    @nn.compact
    def __call__(self, grid: jax.Array) -> jax.Array:
        channels, hidden = grid.shape[-1], grid
        if self.expand > 1:
            hidden = nn.relu6(nn.Dense(self.expand * channels, name="expand")(hidden))
        hidden = nn.relu6(Depthwise(self.kernel, self.stride, self.frozen, name="depthwise")(hidden))
        hidden = nn.Dense(self.features, name="project")(hidden)
        return grid + hidden if self.stride == 1 and channels == self.features else hidden


class Backbone(nn.Module):
    """sRGB (n, h, w, 3) in [0, 1] -> features at strides 2, 4, 8, 16 and 32. No gradient reaches the stem and the
    first `frozen` stages; where there are any, none reaches the others' depthwise kernels (a third of its cost)."""

    config: DepthNetworkConfig
    frozen: int = 0

    @nn.compact
    def __call__(self, rgb: jax.Array) -> list[jax.Array]:
        grid = nn.relu6(Stem(self.config.stem, name="stem")((rgb - _MEAN) * _SCALE))
        features, number = [], 0
        for stage, (channels, count) in enumerate(zip(self.config.channels, self.config.blocks, strict=True)):
            for block in range(count):
                expand = self.config.expand if stage else 1
                stride = 1 if block else STRIDES[stage]
                sizes = (channels, expand, KERNELS[stage], stride, self.frozen > 0)
                grid = InvertedBlock(*sizes, name=f"block{number:02}")(grid)
                number += 1
            if stage < self.frozen:
                grid = jax.lax.stop_gradient(grid)
            if stage in (0, 1, 2, 4, 6):  # the last ones of their strides
                features.append(grid)
        return features
