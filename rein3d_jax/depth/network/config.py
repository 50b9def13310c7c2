"""Sizes of the distance network. The defaults fit EfficientNet-Lite0's weights (Apache-2.0)."""

from dataclasses import dataclass

from rein3d_jax.errors import InputError
from rein3d_jax.settings import Settings, setting

STAGES = 7  # of EfficientNet
KERNELS = (3, 3, 5, 3, 5, 5, 3)  # rows and columns of each stage's depthwise convolutions
STRIDES = (1, 2, 2, 2, 1, 2, 1)  # of each stage's first block, after a stem of stride 2
COARSEST = 32  # pixels of the picture in one of the coarsest features: a picture's rows are a multiple of it
_COUNT = "[1, inf)"


@dataclass(frozen=True)
class DepthNetworkConfig(Settings):
    """Sizes of the distance network."""

    stem: int = setting(32, "channels of the backbone's first convolution", within=_COUNT)
    channels: tuple[int, ...] = setting((16, 24, 40, 80, 112, 192, 320), "of the backbone's stages", within=_COUNT)
    blocks: tuple[int, ...] = setting((1, 2, 2, 3, 3, 4, 1), "of the backbone's stages", within=_COUNT)
    expand: int = setting(6, "times a block's channels inside it, but for the first stage", within=_COUNT)
    horizon: int = setting(192, "channels of a column of the horizon branch", within=_COUNT)
    heads: int = setting(4, "of the horizon branch's attention; divide `horizon`", within=_COUNT)
    layers: int = setting(3, "of the horizon branch", within=_COUNT)
    looks: int = setting(2, "at the lines in which walls meet floor and ceiling", within="[0, inf)")
    bands: int = setting(
        32, "of latitude, to which the horizon branch averages rows at stride 4; half as many at 8, a quarter above",
        within="[4, inf)",
    )  # fmt: skip
    decoder: tuple[int, int, int, int, int] = setting(
        (128, 96, 64, 48, 32), "channels of the decoder at strides 32, 16, 8, 4, 2", within=_COUNT
    )

    def __post_init__(self):
        super().__post_init__()
        for name in ("channels", "blocks"):
            if len(getattr(self, name)) != STAGES:
                raise InputError(f"{name} must be {STAGES} numbers, not {getattr(self, name)}")
        if self.horizon % self.heads:
            raise InputError(f"heads must divide horizon ({self.horizon}), not be {self.heads}")
