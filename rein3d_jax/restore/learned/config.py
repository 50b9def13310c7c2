"""Sizes of the learned restorer's network. Static under jit, and stored beside the weights."""

from dataclasses import dataclass

from rein3d_jax.errors import InputError
from rein3d_jax.settings import Settings, setting

PATCH = 4  # of the network's pixels a side: a cell of the grid that is convolved
TOKEN = 8  # a side: a token
_SIZE = "[1, inf)"


@dataclass(frozen=True)
class NetworkConfig(Settings):
    """Sizes of the learned restorer's network."""

    rows: int = setting(64, "of its input, a multiple of 8; taller videos are shrunk and enlarged again", within=_SIZE)
    fine: int = setting(64, "channels of a cell of 4 x 4 pixels", within=_SIZE)
    width: int = setting(128, "channels of a token of 8 x 8 pixels, a multiple of 4 x heads", within=_SIZE)
    depth: int = setting(2, "transformer blocks", within=_SIZE)
    heads: int = setting(4, "of the attention", within=_SIZE)
    fine_blocks: int = setting(1, "convolutional blocks on the way down, and as many on the way up", within=_SIZE)
    expand: int = setting(3, "width of a block's hidden layer over its own", within=_SIZE)
    anchor: bool = setting(True, "frames attend to the first one; without, it is as if it were not there")

    def __post_init__(self):
        super().__post_init__()
        if self.width % (4 * self.heads):
            raise InputError(
                f"width must be a multiple of 4 x heads ({4 * self.heads}), not {self.width}: "
                "half of each head rotates with the row, half with the column, in pairs"
            )
        if self.rows % TOKEN:
            raise InputError(f"rows must be a multiple of {TOKEN}, not {self.rows}")
