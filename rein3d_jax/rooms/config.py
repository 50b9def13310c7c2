"""What fixes a room's shapes and its mix. Static under jit."""

from dataclasses import dataclass

from rein3d_jax.errors import InputError

KINDS = ("living_dining", "living", "bedroom", "kitchen", "bathroom")
PAPER_MIX = (6050.0, 2000.0, 3000.0, 2000.0, 2000.0)  # scenes of PanoV2V-15K, appendix "Detailed Overview"
EYE_HEIGHT = 1.6  # metres above the floor; Sec. 3


@dataclass(frozen=True)
class RoomConfig:
    mix: tuple[float, ...] = PAPER_MIX  # weights of KINDS
    clearance: float = 0.45  # metres, free around the origin
    furnished: float = 1.0  # 0 = empty rooms, 1 = as full as its kind allows
    open_windows: float = 0.5  # share of rooms whose windows have a colour but no distance
    boxes: int = 144  # capacities; Room.overflow counts what found no slot
    cylinders: int = 32
    ellipsoids: int = 32

    def __post_init__(self):
        if len(self.mix) != len(KINDS) or min(self.mix) < 0 or not sum(self.mix) > 0:
            raise InputError(f"rooms.mix {self.mix} must hold {len(KINDS)} weights, one each of {', '.join(KINDS)}")
        if not 0.1 <= self.clearance <= 0.7:
            raise InputError(f"rooms.clearance {self.clearance} must lie between 0.1 and 0.7 metres")
        if not 0 <= self.furnished <= 1:
            raise InputError(f"rooms.furnished {self.furnished} must lie between 0 and 1")
        if not 0 <= self.open_windows <= 1:
            raise InputError(f"rooms.open_windows {self.open_windows} must lie between 0 and 1")
        for name in ("boxes", "cylinders", "ellipsoids"):
            if getattr(self, name) < 8 or getattr(self, name) % 8:
                raise InputError(f"rooms.{name} {getattr(self, name)} must be a multiple of 8, and not 0")
