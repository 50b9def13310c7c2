"""A job and what it has made, and the pictures of it that its report shows."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from experiments.reconstruct.config import ReconstructConfig
from rein3d_jax.depth.level import Lean
from rein3d_jax.evaluate.coverage import coverage
from rein3d_jax.explore.hidden import DOUBTFUL
from rein3d_jax.io.rooms.traced_room import View
from rein3d_jax.pipeline.reconstruct import Reconstruction
from rein3d_jax.pipeline.survey import Survey


@dataclasses.dataclass(frozen=True)
class Run:
    """What a job has made, and what it was asked for."""

    config: ReconstructConfig
    result: Reconstruction | Survey  # a survey, while the job goes on
    estimated: bool  # whether the distance was, by stages.depth.method
    converted: str  # what was done to a given distance, in words; "" = nothing
    views: list[View]  # ground truth, in the levelled panorama's world
    lean: Lean  # of the picture as it came

    @property
    def finished(self) -> bool:
        """Whether there is more than a survey."""
        return isinstance(self.result, Reconstruction)

    @property
    def distance_origin(self) -> str:
        """Where the distance came from, in few words."""
        estimate = {"shell": "room-shell estimate", "network": "depth network's estimate"}
        return estimate[self.config.depth.method] if self.estimated else "given"

    @property
    def in_doubt(self) -> float:
        """Share of the sphere whose distance is doubtful; 0 where it was given, or nobody knows."""
        return float(coverage(self.result.panorama.doubt > DOUBTFUL))

    @property
    def backdrop(self) -> jax.Array:
        """(3,) sRGB of what no splat covers."""
        return jnp.mean(self.result.panorama.rgb, axis=(0, 1))


@dataclasses.dataclass(frozen=True)
class Pictures:
    """Of the lifted and of the refined scene: panoramas at the ends of the longest paths, holes black, and what the
    ground-truth views show."""

    coarse_ends: list[np.ndarray]
    refined_ends: list[np.ndarray]
    coarse_views: list[np.ndarray]
    refined_views: list[np.ndarray]
