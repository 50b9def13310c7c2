"""What fixes the network's shapes. Static under jit, and stored beside the weights."""

import dataclasses

from rein3d_jax.errors import InputError

PATCH = 4  # of the network's pixels a side: a cell of the grid that is convolved
TOKEN = 8  # a side: a token


@dataclasses.dataclass(frozen=True)
class NetworkConfig:
    rows: int = 64  # that the network sees; a taller video is shrunk to them, and what comes out is enlarged
    fine: int = 64  # channels of a cell
    width: int = 128  # of a token
    depth: int = 2  # transformer blocks
    heads: int = 4
    fine_blocks: int = 1  # convolutional blocks on the way down, and as many on the way up
    expand: int = 3  # width of a block's hidden layer over its own
    anchor: bool = True  # frames look at the first one; without, it is as if it were not there

    def __post_init__(self):
        if self.width % (4 * self.heads):
            raise InputError(
                f"network.width {self.width} must be a multiple of 4 x network.heads {self.heads}: "
                "half of each head turns with the row, half with the column, in pairs"
            )
        if self.rows % TOKEN:
            raise InputError(f"network.rows {self.rows} must be a multiple of {TOKEN}")
        if min(self.rows, self.fine, self.width, self.depth, self.heads, self.fine_blocks, self.expand) < 1:
            raise InputError("network: every size must be at least 1")
