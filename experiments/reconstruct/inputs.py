"""What a job starts from: the panorama, its distance where one is given, and ground-truth views where there are any."""

import dataclasses
import hashlib
import math
from pathlib import Path

import jax
import jax.numpy as jnp

from experiments.reconstruct.given_distance import given_distance, in_metres
from rein3d_jax.conventions import EYE_HEIGHT
from rein3d_jax.depth.kinds import DISTANCE_KINDS, METRIC_KINDS
from rein3d_jax.depth.level import Lean, estimate_lean, lean_of, levelled, unasked_lean
from rein3d_jax.errors import InputError
from rein3d_jax.evaluate.coverage import coverage
from rein3d_jax.geometry.poses import rigid
from rein3d_jax.io.files.input_file import require_file
from rein3d_jax.io.pictures.distance import read_distance
from rein3d_jax.io.pictures.gpano import Pose
from rein3d_jax.io.pictures.panorama import whole_colours
from rein3d_jax.io.pictures.photo import Photo, panorama_rows, read_photo
from rein3d_jax.io.rooms import traced_room
from rein3d_jax.io.rooms.traced_room import View
from rein3d_jax.scene import Panorama
from rein3d_jax.settings import Settings, setting
from rein3d_jax.upsample import BICUBIC, LEARNED, NONE, upsample_picture

SAMPLES = Path(__file__).parents[1] / "samples"
_STEP, _FEWEST = 32, 64  # rows to work at


@dataclasses.dataclass(frozen=True)
class InputConfig(Settings):
    """The picture, what is known of it, and the rows to work at. Paths may start with "sample:", the folder of samples
    that comes with the package."""

    panorama: str = setting("sample:room/input.png", "an equirectangular JPEG, PNG, EXR or HDR, twice as wide as high")
    distance: str | None = setting(
        "sample:room/input_distance.exr", "metres along each ray: EXR, 16-bit PNG (mm), NPY, NPZ; none: it is estimated"
    )
    views: str | None = setting("sample:room/scene.json", "ground-truth views, for measuring only")
    height: int = setting(
        256,
        "rows to work at, a multiple of 32; a smaller picture keeps its own",
        within="[64, 4096]",
    )
    upsample: str = setting(
        NONE, "doubles a smaller picture's rows, before all else, while height allows", among=(NONE, BICUBIC, LEARNED)
    )
    level: bool = setting(True, "a picture that leans is levelled before all else; false: it is taken as level")
    pose: str = setting(
        "believe", "GPano tags of roll and pitch, before what the picture's lines say", among=("believe", "ignore")
    )
    camera_height: float | None = setting(
        None, f"of the lens above the floor: the scale; none: {EYE_HEIGHT}, a guess", within="(0, inf)", unit="metres"
    )
    distance_kind: str = setting(
        "distance",
        "along rays; planar z of cube faces; inverse distance, or distance, up to a factor",
        among=DISTANCE_KINDS,
    )
    distance_unit: float | None = setting(
        None, "of the map's numbers; none: metres, or millimetres of whole numbers", within="(0, inf)", unit="metres"
    )
    scale: str = setting(
        "metres",
        "of a given distance: its own, or by the camera's height above its floor; disparity and relative have none",
        among=("metres", "camera_height"),
    )

    def __post_init__(self):
        super().__post_init__()
        if self.height % _STEP:
            raise InputError(f"height must be a multiple of {_STEP}, not {self.height}")

    def rows(self, of_picture: int) -> int:
        """Rows to work at for a picture of so many: no more than it has, but for what upsampling adds."""
        return self.own_rows(of_picture) << self.doublings(of_picture)

    def own_rows(self, of_picture: int) -> int:
        """Rows of the picture before it is upsampled."""
        return min(self.height, max(of_picture // _STEP * _STEP, _FEWEST))

    def doublings(self, of_picture: int) -> int:
        """How often it is upsampled."""
        return 0 if self.upsample == NONE else int(math.log2(self.height / self.own_rows(of_picture)))

    @property
    def eye_height(self) -> float:
        """Metres of the lens above the floor: as given, or a guess."""
        return EYE_HEIGHT if self.camera_height is None else self.camera_height

    @property
    def scaled(self) -> bool:
        """Whether the camera's height gives a given distance its metres."""
        return self.scale == "camera_height" or self.distance_kind not in METRIC_KINDS


def resolve(path: str) -> Path:
    """The file that a path of the config means."""
    return SAMPLES / path.removeprefix("sample:") if path.startswith("sample:") else Path(path)


def input_panorama(config: InputConfig, upsampler: dict | None = None) -> Panorama:
    """The panorama at the working height, level, distance in metres along the ray; where none is given, none is
    valid. `upsampler` holds the network's parameters, where config.upsample is "learned"."""
    return told_panorama(config, upsampler)[0]


def told_panorama(config: InputConfig, upsampler: dict | None = None) -> tuple[Panorama, str, Lean]:
    """The same; what was made up in the picture, and done to a given distance to make it metres along the ray, in
    words, "" for nothing; and how the picture leaned."""
    path = resolve(config.panorama)
    require_file(path)
    if config.distance is None:
        rgb, pose, missing = _picture(path, config, upsampler)
        unknown = jnp.zeros(rgb.shape[:2])
        panorama, lean = _levelled(Panorama(rgb, unknown, unknown > 0), config, pose)
        return panorama, missing, lean
    given, kind = resolve(config.distance), config.distance_kind
    # A bad file is refused before the picture is upsampled.
    numbers = read_distance(given, metres=kind == "distance", unit=config.distance_unit)
    rgb, pose, missing = _picture(path, config, upsampler)
    panorama, converted = given_distance(rgb, numbers, given, kind)
    panorama, lean = _levelled(panorama, config, pose)  # a floor is looked for below
    panorama, scaled = in_metres(panorama, given, config.eye_height if config.scaled else None)
    return panorama, "; ".join(filter(None, (missing, converted, scaled))), lean


def picture_rows(config: InputConfig) -> int:
    """Rows of the picture as it is in its file. Raises InputError as `read_photo` does for its header."""
    return panorama_rows(resolve(config.panorama))


def _picture(path: Path, config: InputConfig, upsampler: dict | None) -> tuple[jax.Array, Pose, str]:
    """The picture (h, 2 h, 3) at the rows to work at, the pose that its file tells, and what of it was made up."""
    photo = read_photo(path)
    rgb = jnp.asarray(whole_colours(photo, config.own_rows(photo.rows)))
    for _ in range(config.doublings(photo.rows)):
        rgb = upsample_picture(rgb, config.upsample, upsampler)
    return rgb, photo.pose, _made_up(photo)


def _made_up(photo: Photo) -> str:
    if photo.seen.all():
        return ""
    unseen = 1 - float(coverage(jnp.asarray(photo.seen, jnp.float32)))
    return f"{unseen:.1%} of the picture is transparent, black at a pole or cropped away: it takes the colours around"


def _levelled(panorama: Panorama, config: InputConfig, pose: Pose) -> tuple[Panorama, Lean]:
    if not config.level:
        lean = unasked_lean()
    elif config.pose == "believe" and pose.leans:
        lean = lean_of(pose.roll, pose.pitch)
    else:
        lean = estimate_lean(panorama.rgb)
    return levelled(panorama, lean), lean


def input_views(config: InputConfig) -> list[View]:
    """The views that a scene.json lists; [] where the config names none."""
    return [] if config.views is None else list(traced_room.read_posed_views(resolve(config.views), anywhere=True))


def levelled_views(views: list[View], lean: Lean) -> list[View]:
    """The views in the world of the panorama that `lean` levelled."""
    turn = rigid(lean.level_from_picture, jnp.zeros(3))
    poses = [jnp.matmul(turn, view.camera.world_from_camera, precision="highest") for view in views]
    cameras = [view.camera.replace(world_from_camera=pose) for view, pose in zip(views, poses, strict=True)]
    return [dataclasses.replace(view, camera=camera) for view, camera in zip(views, cameras, strict=True)]


def input_fingerprint(config: InputConfig) -> str:
    """What the input files hold, as one hash: a resumed job must not mix two pictures."""
    digest = hashlib.sha256()
    for name in (config.panorama, config.distance):
        if name is not None:
            path = resolve(name)
            require_file(path)
            digest.update(path.read_bytes())
    return digest.hexdigest()
