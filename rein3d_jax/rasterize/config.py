"""What fixes the rasterizer's picture. Static under jit."""

import dataclasses

from rein3d_jax.conventions import FAR, NEAR
from rein3d_jax.errors import InputError
from rein3d_jax.settings import Settings, setting

LEAST, ADDED = "least", "added"


@dataclasses.dataclass(frozen=True)
class RasterizeConfig(Settings):
    """How Gaussians become a picture."""

    antialias: bool = setting(True, "scale opacity by what the screen-space filter spread out (Mip-Splatting, eq. 9)")
    filter: str = setting(
        LEAST, "that widens footprints: to a pixel at least, or by a pixel each", among=(LEAST, ADDED)
    )
    distance: bool = setting(True, "composite the distance too; without it a frame has none, and compositing is faster")
    # 1/12 is a pixel's own, a box's; Mip-Splatting adds 0.1, 3DGS 0.3.
    filter_variance: float = setting(1 / 12, "variance of the filter", within="(0, inf)", unit="pixels^2")
    near: float = setting(NEAR, "distance below which nothing is drawn", within="(0, inf)", unit="metres")
    far: float = setting(FAR, "distance beyond which nothing is drawn", within="(0, inf]", unit="metres")
    # 8 x 8 beats 16 x 16 for pixel-sized splats.
    tile: int = setting(8, "side of a tile; it must divide a panorama's width", within="[1, inf)", unit="pixels")
    chunk: int = setting(32, "Gaussians composited before joining a tile's chunks", within="[1, inf)")

    def __post_init__(self):
        super().__post_init__()
        if self.near >= self.far:
            raise InputError(f"near {self.near} must be below far {self.far}")
