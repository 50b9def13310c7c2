"""Distance -> safe camera paths and evaluation viewpoints."""

from rein3d_jax.explore.profile import ExploreConfig
from rein3d_jax.explore.trajectories import Trajectories, path_ends, radial_trajectories

__all__ = ["ExploreConfig", "Trajectories", "path_ends", "radial_trajectories"]
