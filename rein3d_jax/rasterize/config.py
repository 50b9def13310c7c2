"""What fixes the rasterizer's shapes and its picture. Static under jit."""

import dataclasses

from rein3d_jax.conventions import FAR, NEAR
from rein3d_jax.errors import InputError


@dataclasses.dataclass(frozen=True)
class RasterizeConfig:
    """The last four are buffer sizes: 0 means "measure them", which `allocate` and `render` do."""

    antialias: bool = True  # scale opacity by what the screen-space filter spread out (Mip-Splatting, eq. 9)
    distance: bool = True  # composite the distance too; without it a frame has none, and compositing is faster
    filter_variance: float = 0.3  # pixels^2 added to every footprint (3DGS and gsplat)
    near: float = NEAR  # metres
    far: float = FAR  # metres
    tile: int = 8  # pixels; 8 x 8 beats 16 x 16 for pixel-sized splats (design.md)
    chunk: int = 32  # Gaussians composited before joining a tile's chunks
    visible_capacity: int = 0  # Gaussians in view
    row_capacity: int = 0  # (Gaussian, row of tiles) pairs
    pair_capacity: int = 0  # (Gaussian, tile) pairs
    chunk_capacity: int = 0  # chunks over all tiles

    def __post_init__(self):
        if not 0 < self.near < self.far:
            raise InputError(f"rasterize.near {self.near} must lie between 0 and rasterize.far {self.far}")
        if self.tile < 1 or self.chunk < 1:
            raise InputError("rasterize.tile and rasterize.chunk must be at least 1")
        if self.filter_variance <= 0:
            raise InputError("rasterize.filter_variance must be above 0: a splat thinner than a pixel would vanish")

    @property
    def buffers(self) -> tuple[int, int, int, int]:
        """The buffer sizes, in the order of `Frame.needed`."""
        return self.visible_capacity, self.row_capacity, self.pair_capacity, self.chunk_capacity
