"""A training example of the learned restorer: a straight path through a drawn room, what the first panorama shows of
it, its fills, and the truth."""

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from rein3d_jax.depth.shell_from_distance import shell_from_distance
from rein3d_jax.errors import InputError
from rein3d_jax.explore.chord import longest_chord
from rein3d_jax.explore.profile import ExploreConfig
from rein3d_jax.geometry.poses import rigid
from rein3d_jax.geometry.resample import sample_sphere
from rein3d_jax.geometry.sphere import pixel_rays, pixels_from_rays, world_from_camera_axes
from rein3d_jax.pipeline.pairs import PairConfig, degrade
from rein3d_jax.restore import Background, background_of
from rein3d_jax.restore.learned.candidates import clip_of
from rein3d_jax.restore.learned.loss import Example
from rein3d_jax.restore.learned.predict import halved_clip
from rein3d_jax.rooms.config import RoomConfig
from rein3d_jax.rooms.generate import generate_room
from rein3d_jax.rooms.model import Room
from rein3d_jax.rooms.tracing.trace import trace
from rein3d_jax.scene import Panorama
from rein3d_jax.settings import Settings, setting

_SCOUT = 32  # rows of the panoramas by which a path is chosen and the shell found
_ATTEMPTS = 200  # rooms drawn for one path
_SHARE = "[0, 1]"


@dataclasses.dataclass(frozen=True)
class ExamplesConfig(Settings):
    """Training examples of the learned restorer: paths through drawn rooms."""

    output: str = setting("runs/examples", "folder of the examples")
    count: int = setting(1000, "examples", within="[1, inf)")
    seed: int = setting(0, "of all that is drawn", within="[0, inf)")
    frames: int = setting(6, "of each path, the anchor among them", within="[2, inf)")
    height: int = setting(128, "rendered, a multiple of 32; half is stored", within="[32, inf)", unit="rows")
    min_length: float = setting(1.0, "of a path", within="(0, inf)", unit="metres")
    max_length: float = setting(3.0, "of a path", within="(0, inf)", unit="metres")
    min_hidden: float = setting(0.02, "share of the last frame that the anchor must not see", within=_SHARE)
    furnished: tuple[float, ...] = setting((0.2, 0.5, 0.9), "rooms.furnished, example by example", within=_SHARE)
    shell_support: float = setting(0.3, "share on a box, below which a room has no shell", within="[0, inf)")
    misplaced: float = setting(0.3, "share of examples whose shell's walls are off by up to 15 %", within=_SHARE)
    explore: ExploreConfig = ExploreConfig(camera_radius=0.15, stop_buffer=0.15)
    rooms: RoomConfig = RoomConfig()

    def __post_init__(self):
        super().__post_init__()
        if self.height % 32:
            raise InputError(f"height must be a multiple of 32, not {self.height}")
        if self.min_length > self.max_length:
            raise InputError(f"min_length must be at most max_length ({self.max_length:g}), not {self.min_length:g}")
        if not self.furnished:
            raise InputError("furnished must have an entry")


def example(index: int, config: ExamplesConfig) -> Example:
    """Example `index` of a config, config.height / 2 rows, NumPy. Raises InputError where no room has a path that hides
    enough."""
    key = jax.random.fold_in(jax.random.key(config.seed), index)
    place, start, offsets, shell_key = _room_and_path(key, index, config)
    seen = _trace(place, _pose(start[None]), config.height)
    source = Panorama(seen.rgb[0], seen.distance[0], seen.distance[0] > 0)
    video = degrade(source, _pose(offsets), config=PairConfig(height=config.height))
    background = _background(shell_key, place, start, source, config)
    clip = clip_of(video, observed=0.5, background=background)
    small = jax.tree.map(lambda x: x[0], _halved(jax.tree.map(lambda x: x[None], clip)))
    clean = _trace(place, _pose(start + offsets), config.height // 2)
    return jax.tree.map(np.asarray, Example(small, clean.rgb, clean.distance))


def _room_and_path(key: jax.Array, index: int, config: ExamplesConfig):
    """Room, start (3,), positions (t, 3) from there, and a key for what is left to draw."""
    rooms = dataclasses.replace(config.rooms, furnished=config.furnished[index % len(config.furnished)])
    for attempt in range(_ATTEMPTS):
        room_key, path_key, rest = jax.random.split(jax.random.fold_in(key, attempt), 3)
        place = _room(room_key, rooms)
        start, offsets, hidden = _draw_path(path_key, place, config)
        if float(hidden) >= config.min_hidden:
            return place, start, offsets, rest
    raise InputError(
        f"none of {_ATTEMPTS} rooms has a path of {config.min_length:g} m that uncovers {config.min_hidden:g}"
    )


@partial(jax.jit, static_argnames="config")
def _draw_path(key: jax.Array, place: Room, config: ExamplesConfig):
    """Start, positions, and share of the last frame that is hidden from the start; -1 where the path is too short."""
    long, begin, way, steps = jax.random.split(key, 4)
    seen = trace(place, _pose(jnp.zeros(3)), _SCOUT).distance
    path = longest_chord(seen, seen > 0, config=config.explore)
    limit = jnp.minimum(path.length, config.max_length)
    length = jax.random.uniform(long, minval=config.min_length, maxval=jnp.maximum(limit, config.min_length))
    first = jax.random.uniform(begin) * jnp.maximum(path.length - length, 0)
    back = jax.random.bernoulli(way)
    start = path.start + jnp.where(back, path.length - first, first) * path.direction
    parts = jnp.arange(1, config.frames) - jax.random.uniform(steps, (config.frames - 1,), maxval=0.5)
    along = jnp.concatenate([jnp.zeros(1), length * parts / (config.frames - 1)])
    offsets = along[:, None] * path.direction * jnp.where(back, -1.0, 1.0)
    hidden = _hidden(place, start, offsets[-1])
    return start, offsets, jnp.where(path.length < config.min_length, -1.0, hidden)


def _hidden(place: Room, start: jax.Array, offset: jax.Array) -> jax.Array:
    """Share of the pixels seen at start + offset that lie behind what is seen from start."""
    both = trace(place, _pose(jnp.stack([start, start + offset])), _SCOUT).distance
    both = jnp.where(both > 0, both, 100.0)
    points = offset + both[1][..., None] * pixel_rays(*both.shape[1:])
    inverse = sample_sphere(1 / both[0][..., None], *pixels_from_rays(points, *both.shape[1:]))[..., 0]
    return jnp.mean(jnp.linalg.norm(points, axis=-1) * inverse > 1.15)


def _background(key: jax.Array, place: Room, start: jax.Array, source: Panorama, config) -> Background | None:
    """Background of the shell as the main job finds it, or off: a network trained on walls that fit trusts them
    blindly."""
    seen = _trace(place, _pose(start), _SCOUT)
    shell, support = shell_from_distance(Panorama(seen.rgb, seen.distance, seen.distance > 0))
    if float(support) < config.shell_support:
        return None
    off, by = jax.random.split(key)
    scale = jax.random.uniform(by, (4,), minval=-0.15, maxval=0.15) * jax.random.bernoulli(off, config.misplaced)
    return background_of(source, shell.replace(walls=shell.walls * (1 + scale)))


def _pose(position: jax.Array) -> jax.Array:
    return rigid(jnp.broadcast_to(world_from_camera_axes(), (*position.shape[:-1], 3, 3)), position)


_room = jax.jit(generate_room, static_argnums=1)
_trace = jax.jit(trace, static_argnames="height")
_halved = jax.jit(halved_clip)
