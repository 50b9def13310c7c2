"""Super-resolution of the input picture and of restored frames (paper Sec. 3.3)."""

from rein3d_jax.upsample.config import BICUBIC, LEARNED, NONE, UpsampleConfig
from rein3d_jax.upsample.distance import coarser_distance, distance_for, finer_distance
from rein3d_jax.upsample.upsample import then_upsample, upsample_picture, upsample_video

__all__ = [
    "BICUBIC",
    "LEARNED",
    "NONE",
    "UpsampleConfig",
    "coarser_distance",
    "distance_for",
    "finer_distance",
    "then_upsample",
    "upsample_picture",
    "upsample_video",
]
