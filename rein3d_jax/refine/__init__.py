"""Observations -> a better scene: losses, optimizer, densification in masked fixed-size buffers, the step, the loop."""

from rein3d_jax.refine.config import DensifyConfig, PhotometricConfig, RatesConfig, RefineConfig, ViewsConfig
from rein3d_jax.refine.refine import evaluate_held_out, refine
from rein3d_jax.refine.snapshot import Curves, Snapshot, blank_snapshot, first_snapshot
from rein3d_jax.refine.state import Still
from rein3d_jax.refine.views import Views, join_views, views_from_panorama

__all__ = [
    "Curves",
    "DensifyConfig",
    "PhotometricConfig",
    "RatesConfig",
    "RefineConfig",
    "Snapshot",
    "Still",
    "Views",
    "ViewsConfig",
    "blank_snapshot",
    "evaluate_held_out",
    "first_snapshot",
    "join_views",
    "refine",
    "views_from_panorama",
]
