"""Panorama + distance -> Gaussians."""

from rein3d_jax.lift.adaptive import lift_adaptively
from rein3d_jax.lift.buffer import compact, merge, with_capacity
from rein3d_jax.lift.config import LiftConfig
from rein3d_jax.lift.lift import lift
from rein3d_jax.lift.lining import lining

__all__ = ["LiftConfig", "compact", "lift", "lift_adaptively", "lining", "merge", "with_capacity"]
