"""Observations -> a better scene: losses, optimizer, densification in masked fixed-size buffers, the step, the loop."""

from rein3d_jax.refine.config import RefineConfig
from rein3d_jax.refine.refine import refine
from rein3d_jax.refine.views import Views, join_views, views_from_panorama

__all__ = ["RefineConfig", "Views", "join_views", "refine", "views_from_panorama"]
