"""Observations -> a better scene: losses, optimizer, densification in masked fixed-size buffers, the step, the loop."""

from rein3d_jax.refine.config import RefineConfig
from rein3d_jax.refine.refine import STOPPED, Snapshot, blank_snapshot, refine
from rein3d_jax.refine.views import Views, join_views, views_from_panorama

__all__ = [
    "STOPPED",
    "RefineConfig",
    "Snapshot",
    "Views",
    "blank_snapshot",
    "join_views",
    "refine",
    "views_from_panorama",
]
