"""Panorama + distance -> Gaussians."""

from rein3d_jax.lift.buffer import compact, merge, with_capacity
from rein3d_jax.lift.lift import LiftConfig, lift

__all__ = ["LiftConfig", "compact", "lift", "merge", "with_capacity"]
