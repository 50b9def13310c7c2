"""Gaussians + cameras -> colour, alpha, distance: project, tile, composite; reference.py is the slow dense oracle."""

from rein3d_jax.rasterize.config import RasterizeConfig
from rein3d_jax.rasterize.contribution import accumulated_weight
from rein3d_jax.rasterize.rasterize import Frame, allocate, bucket, enlarge, rasterize, render

__all__ = [
    "Frame",
    "RasterizeConfig",
    "accumulated_weight",
    "allocate",
    "bucket",
    "enlarge",
    "rasterize",
    "render",
]
