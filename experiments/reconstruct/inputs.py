"""What a job starts from: the panorama, its distance (given, or fitted), and ground-truth views where there are any."""

import dataclasses
import hashlib
from pathlib import Path

from rein3d_jax.conventions import EYE_HEIGHT
from rein3d_jax.errors import InputError
from rein3d_jax.io.files.input_file import require_file
from rein3d_jax.io.pictures.panorama import read_panorama
from rein3d_jax.io.rooms import traced_room
from rein3d_jax.io.rooms.traced_room import View
from rein3d_jax.scene import Panorama
from rein3d_jax.settings import Settings, setting

SAMPLES = Path(__file__).parents[1] / "samples"


@dataclasses.dataclass(frozen=True)
class InputConfig(Settings):
    """The picture, what is known of it, and the rows to work at. Paths may start with "sample:", the folder of samples
    that comes with the package."""

    panorama: str = setting("sample:room/input.png", "an equirectangular JPEG, PNG, EXR or HDR, twice as wide as high")
    distance: str | None = setting(
        "sample:room/input_distance.exr", "metres along each ray: EXR, 16-bit PNG (mm), NPY, NPZ; none: a box is fitted"
    )
    views: str | None = setting("sample:room/scene.json", "ground-truth views, for measuring only")
    height: int = setting(256, "rows that the job works at, a multiple of 32", within="[64, 4096]")
    camera_height: float | None = setting(
        None, f"of the lens above the floor: the scale; none: {EYE_HEIGHT}, a guess", within="(0, inf)", unit="metres"
    )

    def __post_init__(self):
        super().__post_init__()
        if self.height % 32:
            raise InputError(f"height must be a multiple of 32, not {self.height}")

    @property
    def eye_height(self) -> float:
        """Metres of the lens above the floor: as given, or a guess."""
        return EYE_HEIGHT if self.camera_height is None else self.camera_height


def resolve(path: str) -> Path:
    """The file that a path of the config means."""
    return SAMPLES / path.removeprefix("sample:") if path.startswith("sample:") else Path(path)


def input_panorama(config: InputConfig) -> Panorama:
    """The panorama at the working height; where no distance is given, none is valid."""
    path = resolve(config.panorama)
    require_file(path)
    distance = None if config.distance is None else resolve(config.distance)
    return read_panorama(path, distance=distance, height=config.height)


def input_views(config: InputConfig) -> list[View]:
    """The views that a scene.json lists; [] where the config names none."""
    return [] if config.views is None else list(traced_room.read_posed_views(resolve(config.views), anywhere=True))


def input_fingerprint(config: InputConfig) -> str:
    """What the input files hold, as one hash: a resumed job must not mix two pictures."""
    digest = hashlib.sha256()
    for name in (config.panorama, config.distance):
        if name is not None:
            path = resolve(name)
            require_file(path)
            digest.update(path.read_bytes())
    return digest.hexdigest()
