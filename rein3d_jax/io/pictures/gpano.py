"""What cameras and stitchers write beside a panorama (XMP, Google's GPano): its place on the sphere, and its pose."""

from dataclasses import dataclass

import OpenImageIO as oiio

_STALE = 0.01  # relative: tags of a picture that was resized keep the shape; others are those of another picture


@dataclass(frozen=True)
class Crop:
    """Where a picture lies in the panorama that it is cut from; all in the picture's own pixels."""

    width: int
    height: int
    left: int
    top: int


@dataclass(frozen=True)
class Pose:
    """Degrees. A camera's heading turns the room and nothing else; it is left out."""

    roll: float = 0.0  # clockwise, right side down
    pitch: float = 0.0  # upward

    @property
    def leans(self) -> bool:
        """Whether it says anything but upright."""
        return bool(self.roll or self.pitch)


def pose_of(spec: oiio.ImageSpec) -> Pose:
    """The pose that the file tells; upright where it tells none."""
    roll, pitch = (_number(spec, f"Pose{name}Degrees") or 0.0 for name in ("Roll", "Pitch"))
    return Pose((roll + 180) % 360 - 180, (pitch + 180) % 360 - 180)


def crop_of(spec: oiio.ImageSpec) -> Crop | None:
    """The crop that the file tells; None where it is whole, or the tags are those of a picture of another shape."""
    names = ("FullPanoWidthPixels", "FullPanoHeightPixels", "CroppedAreaLeftPixels", "CroppedAreaTopPixels",
             "CroppedAreaImageWidthPixels", "CroppedAreaImageHeightPixels")  # fmt: skip
    told = [_number(spec, name) for name in names]
    if None in told or min(told[:2]) <= 0 or min(told[4:]) <= 0:
        return None
    full_width, full_height, left, top, width, height = told
    scale = spec.width / width
    stale = abs(height * scale / spec.height - 1) > _STALE
    inside = left >= 0 and top >= 0 and left + width <= full_width and top + height <= full_height
    whole = (width, height) == (full_width, full_height)
    if stale or whole or not inside or abs(full_width / (2 * full_height) - 1) > _STALE:
        return None
    rows = round(full_height * scale)
    return Crop(2 * rows, rows, round(left * scale), min(round(top * scale), rows - spec.height))


def _number(spec: oiio.ImageSpec, name: str) -> float | None:
    found = spec.getattribute(f"GPano:{name}")
    try:
        return None if found is None else float(found)
    except (TypeError, ValueError):
        return None  # a tag that is no number says nothing
