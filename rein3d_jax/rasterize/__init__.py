"""Gaussians + cameras -> colour, alpha, distance: project, tile, composite; reference.py is the slow dense oracle."""

from rein3d_jax.rasterize.buffers import Buffers, bucket
from rein3d_jax.rasterize.config import ADDED, LEAST, RasterizeConfig
from rein3d_jax.rasterize.contribution import accumulated_weight
from rein3d_jax.rasterize.rasterize import Frame, allocate, rasterize, render

__all__ = [
    "ADDED",
    "LEAST",
    "Buffers",
    "Frame",
    "RasterizeConfig",
    "accumulated_weight",
    "allocate",
    "bucket",
    "rasterize",
    "render",
]
