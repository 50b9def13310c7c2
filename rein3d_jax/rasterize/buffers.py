"""The rasterizer's buffers: sizes that are measured, and that grow where a view needs more."""

from collections.abc import Iterable
from typing import NamedTuple


class Buffers(NamedTuple):
    """The sizes of a compiled rasterizer, hence static under jit, in the order of `Frame.needed`. Sums over buffers of
    other sizes round otherwise: a picture's bytes are those of its scene, camera, config and buffers."""

    visible: int  # Gaussians in view
    rows: int  # (Gaussian, row of tiles) pairs
    pairs: int  # (Gaussian, tile) pairs
    chunks: int  # chunks over all tiles

    def hold(self, needed: Iterable) -> bool:
        """Whether the sizes `needed` (4,) fit."""
        return all(int(new) <= size for size, new in zip(self, needed, strict=True))

    def enlarged(self, needed: Iterable, slack: float = 1) -> "Buffers":
        """Buffers for at least `needed` (4,) times `slack`, each a `bucket`, and none smaller than it was."""
        return Buffers(*(max(old, bucket(int(new * slack))) for old, new in zip(self, needed, strict=True)))


def bucket(count: int) -> int:
    """The next of 1, 1.25, 1.5, 1.75 x 2^k: near sizes share a compiled program, at most 25 % is idle."""
    count = max(count, 64)
    step = 1 << max(count.bit_length() - 3, 0)
    return -(-count // step) * step
