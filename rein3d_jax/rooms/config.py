"""Shapes and mix of the rooms that are drawn. Static under jit."""

from dataclasses import dataclass

from rein3d_jax.errors import InputError
from rein3d_jax.settings import Settings, setting

ROOM_KINDS = ("living_dining", "living", "bedroom", "kitchen", "bathroom")
PAPER_MIX = (6050.0, 2000.0, 3000.0, 2000.0, 2000.0)  # scenes of Rein3D's data set, PanoV2V-15K, by kind
_CAPACITIES = ("boxes", "cylinders", "ellipsoids")


@dataclass(frozen=True)
class RoomConfig(Settings):
    """Rooms drawn by key: which kinds, how full, and the sizes of their buffers."""

    mix: tuple[float, ...] = setting(PAPER_MIX, f"weights of {', '.join(ROOM_KINDS)}", within="[0, inf)")
    clearance: float = setting(0.45, "free floor around the origin", within="[0.1, 0.7]", unit="metres")
    furnished: float = setting(1.0, "0: empty rooms, 1: as full as their kind allows", within="[0, 1]")
    open_windows: float = setting(0.5, "share of rooms whose windows have a colour but no distance", within="[0, 1]")
    boxes: int = setting(144, "boxes a room can hold, a multiple of 8; those left out are counted", within="[8, inf)")
    cylinders: int = setting(32, "cylinders a room can hold, a multiple of 8", within="[8, inf)")
    ellipsoids: int = setting(32, "ellipsoids a room can hold, a multiple of 8", within="[8, inf)")

    def __post_init__(self):
        super().__post_init__()
        if len(self.mix) != len(ROOM_KINDS) or not sum(self.mix) > 0:
            raise InputError(f"mix must be {len(ROOM_KINDS)} weights, not all 0, not {self.mix}")
        for name in _CAPACITIES:
            if getattr(self, name) % 8:
                raise InputError(f"{name} must be a multiple of 8, not {getattr(self, name)}")
