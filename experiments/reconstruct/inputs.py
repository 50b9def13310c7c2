"""What a job starts from: the panorama, its distance (given, or fitted), and ground-truth views where there are any."""

import dataclasses
import hashlib
from pathlib import Path

import jax.numpy as jnp

from rein3d_jax.depth.complete import CompleteConfig, complete_distance
from rein3d_jax.depth.room_shell import RoomShellConfig, fit_room_shell, shell_distance
from rein3d_jax.errors import InputError
from rein3d_jax.io.files.input_file import require_file
from rein3d_jax.io.pictures.distance import read_distance
from rein3d_jax.io.pictures.image import read_rgb, resize_panorama
from rein3d_jax.io.rooms import traced_room
from rein3d_jax.io.rooms.traced_room import View
from rein3d_jax.scene import Panorama

SAMPLES = Path(__file__).parents[1] / "samples"
GIVEN, FITTED = "given", "room-shell estimate"


@dataclasses.dataclass(frozen=True)
class InputConfig:
    """Paths may start with "sample:", the folder of samples that comes with the package."""

    panorama: str = "sample:room/input.png"
    distance: str | None = "sample:room/input_distance.exr"  # none: a room's shell is fitted to the picture
    views: str | None = "sample:room/scene.json"  # ground-truth views, for measuring only
    height: int = 256  # rows that the job works at; the width is twice that

    def __post_init__(self):
        if self.height % 32 or not 64 <= self.height <= 4096:
            raise InputError(f"input.height {self.height} must be a multiple of 32 from 64 to 4096")


def resolve(path: str) -> Path:
    """The file that a path of the config means."""
    return SAMPLES / path.removeprefix("sample:") if path.startswith("sample:") else Path(path)


def read_panorama(config: InputConfig, depth: CompleteConfig, shell: RoomShellConfig) -> tuple[Panorama, str]:
    """The panorama at the working height, its distance complete, and whether that was GIVEN or FITTED."""
    path = resolve(config.panorama)
    require_file(path)
    rgb = read_rgb(path)
    if config.distance is None:
        rgb, _, _ = resize_panorama(rgb, None, None, config.height)
        rgb = jnp.asarray(rgb)
        box, _ = fit_room_shell(rgb, config=shell)
        distance = shell_distance(box, config.height, 2 * config.height)
        return Panorama(rgb, distance, jnp.ones(distance.shape, bool)), FITTED
    distance, valid = read_distance(resolve(config.distance), rgb.shape[:2])
    rgb, distance, valid = (jnp.asarray(x) for x in resize_panorama(rgb, distance, valid, config.height))
    return Panorama(rgb, complete_distance(distance, valid, config=depth), valid), GIVEN


def read_views(config: InputConfig) -> list[View]:
    """The views of a scene.json as ../shared/rooms has them; [] where the config names none."""
    return [] if config.views is None else list(traced_room.read_views(resolve(config.views), anywhere=True))


def fingerprint(config: InputConfig) -> str:
    """What the input files hold, as one hash: a resumed job must not mix two pictures."""
    digest = hashlib.sha256()
    for name in (config.panorama, config.distance):
        if name is not None:
            path = resolve(name)
            require_file(path)
            digest.update(path.read_bytes())
    return digest.hexdigest()
