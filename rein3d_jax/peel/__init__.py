"""What a panorama hides, layer behind layer: the room behind what stands in it, the outside behind the room."""

from rein3d_jax.peel.config import PeelConfig
from rein3d_jax.peel.outside import OutsideLayer, outside_of
from rein3d_jax.peel.room import behind_things, without_things

__all__ = ["OutsideLayer", "PeelConfig", "behind_things", "outside_of", "without_things"]
