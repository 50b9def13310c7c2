"""Pairs of clips to learn from (paper Sec. 3): a walk through a place as it is, and as its first panorama, lifted,
shows it. The place is drawn (`room_pair`: pure, for jit and vmap, so that pairs can be made on the device while
training) or any other that can be traced (`scene_pair`: meshes)."""

import dataclasses
from collections.abc import Callable

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.depth.complete import CompleteConfig, complete_distance
from rein3d_jax.errors import InputError
from rein3d_jax.explore.chord import Chord, longest_chord
from rein3d_jax.explore.profile import ExploreConfig
from rein3d_jax.geometry.poses import equirectangular_camera
from rein3d_jax.geometry.safe import safe_divide
from rein3d_jax.lift import LiftConfig, lift
from rein3d_jax.pipeline.stages import level_pose
from rein3d_jax.rasterize import Buffers, RasterizeConfig, bucket, rasterize
from rein3d_jax.rooms.config import RoomConfig
from rein3d_jax.rooms.generate import generate_room
from rein3d_jax.rooms.tracing.trace import trace
from rein3d_jax.scene import Pair, Panorama, Video
from rein3d_jax.settings import Settings, setting

ATTEMPTS = 200  # rooms drawn for one that has the path
_SCOUT_ROWS = 64  # of the panorama by which a room's path is found

# pose (4, 4), rows -> rgb (h, w, 3), distance (h, w), 0 where nothing is hit
PanoramaTracer = Callable[[jax.Array, int], tuple]


@dataclasses.dataclass(frozen=True)
class PairConfig(Settings):
    """A clip of a pair: its frames, and what its degraded twin is made with."""

    height: int = setting(128, "of its frames, a multiple of rasterize.tile", within="[8, inf)", unit="rows")
    source_height: int = setting(0, "of the first panorama as it is lifted; 0: height", within="[0, inf)", unit="rows")
    frames: int = setting(17, "of a clip; the paper's have 41", within="[2, inf)")
    speed: float = setting(1.0, "of the camera", within="(0, inf)", unit="metres a second")
    rate: float = setting(10.0, "of the clip", within="(0, inf)", unit="frames a second")
    samples: int = setting(1, "rays a pixel and side of a room's frames", within="[1, inf)")
    explore: ExploreConfig = ExploreConfig()  # how much clearance a path keeps
    lift: LiftConfig = LiftConfig()
    depth: CompleteConfig = CompleteConfig()  # where what shows through windows is placed, as in the main job
    rasterize: RasterizeConfig = RasterizeConfig()
    rooms: RoomConfig = RoomConfig()

    def __post_init__(self):
        super().__post_init__()
        if self.height % self.rasterize.tile:
            raise InputError(f"height must be a multiple of rasterize.tile {self.rasterize.tile}, not {self.height}")
        if self.source_rows % 2 or self.source_rows < 8:
            raise InputError(f"source_height must be even and at least 8, or 0, not {self.source_height}")

    @property
    def length(self) -> float:
        """Metres walked."""
        return (self.frames - 1) * self.speed / self.rate

    @property
    def source_rows(self) -> int:
        """Rows of the panorama that is lifted."""
        return self.source_height or self.height


@struct.dataclass
class Drawn:
    """A pair, and how it came about."""

    pair: Pair
    length: jax.Array  # () metres of the longest path; where it is shorter than the config's, the pair is none
    draws: jax.Array  # () rooms drawn until one had the path
    needed: jax.Array  # (4,) the rasterizer's buffers that the degraded clip called for


def room_pair(key: jax.Array, config: PairConfig, buffers: Buffers) -> Drawn:
    """The pair of a key: a room with a path of the config's length, drawn again until there is one.

    Pure; for jit (config and buffers static) and vmap over keys. The caller checks `length >= config.length`, and that
    the buffers (`pair_buffers`) hold what is `needed`; else frames miss splats.
    """
    draw_key, path_key = jax.random.split(key)

    def draw(state):
        """The next room, and its longest path."""
        draws, _, _ = state
        place = generate_room(jax.random.fold_in(draw_key, draws), config.rooms)
        distance = trace(place, level_pose(jnp.zeros(3)), _SCOUT_ROWS).distance
        return draws + 1, place, longest_chord(distance, distance > 0, config=config.explore)

    def too_short(state):
        draws, _, path = state
        return (path.length < config.length) & (draws < ATTEMPTS)

    blank = jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), jax.eval_shape(draw, (jnp.int32(0), None, None)))
    draws, place, path = jax.lax.while_loop(too_short, draw, blank)
    offsets, start = clip_places(path_key, path, config)
    clean = trace(place, level_pose(start + offsets), config.height, samples=config.samples)
    source = clean.rgb[0], clean.distance[0]
    if (config.source_rows, config.samples) != (config.height, 1):
        apart = trace(place, level_pose(start), config.source_rows)
        source = apart.rgb, apart.distance
    degraded, needed = _degraded(Panorama(*source, source[1] > 0), level_pose(offsets), config, buffers)
    return Drawn(Pair(_clean(clean.rgb, clean.distance, offsets), degraded), path.length, draws, needed)


def make_pair(key: jax.Array, config: PairConfig) -> Drawn:
    """`room_pair` with buffers that fit. Raises InputError where no room of ATTEMPTS has the path."""
    buffers = pair_buffers(config)
    while True:
        drawn = _room_pair(key, config, buffers)
        if float(drawn.length) < config.length:
            raise InputError(
                f"none of {ATTEMPTS} rooms has a straight path of {config.length:g} m (frames, speed, rate) that keeps "
                f"{config.explore.clearance:g} m clearance (explore); the longest of the last is {drawn.length:.2f} m"
            )
        if buffers.hold(drawn.needed):
            return drawn
        buffers = buffers.enlarged(drawn.needed)


def scene_pair(key: jax.Array, render: PanoramaTracer, config: PairConfig) -> Drawn:
    """The pair of any place that `render` traces, from where its origin stands.

    Raises InputError where its longest path is shorter than the config's, a path of no length included."""
    _, path_key = jax.random.split(key)
    distance = jnp.asarray(render(level_pose(jnp.zeros(3)), _SCOUT_ROWS)[1])
    chord = longest_chord(distance, distance > 0, config=config.explore)
    if float(chord.length) < config.length:
        raise InputError(
            f"the longest straight path through its origin has {chord.length:.2f} m, and a clip walks "
            f"{config.length:g} m: lower frames or speed or explore's clearance, or leave the scene out"
        )
    offsets, start = clip_places(path_key, chord, config)
    source = Panorama(*_seen(render, start, config.source_rows))
    frames = [_seen(render, start + offset, config.height) for offset in offsets]
    rgb, distance, _ = (jnp.stack(part) for part in zip(*frames, strict=True))
    degraded, needed = _fitting(source, level_pose(offsets), config)
    return Drawn(Pair(_clean(rgb, distance, offsets), degraded), chord.length, jnp.int32(1), needed)


def degrade(panorama: Panorama, world_from_camera: jax.Array, *, config: PairConfig = PairConfig()) -> Video:
    """What a panorama (h, 2 h) at the world's origin, lifted, shows at poses (t, 4, 4), in config.height rows."""
    config = dataclasses.replace(config, source_height=panorama.valid.shape[0])
    return _fitting(panorama, world_from_camera, config)[0]


def clip_places(key: jax.Array, path: Chord, config: PairConfig) -> tuple[jax.Array, jax.Array]:
    """Places (t, 3) relative to the first, and the first (3,): a piece of the path drawn by `key`, either way along."""
    where, way = jax.random.split(key)
    begin = jax.random.uniform(where) * jnp.maximum(path.length - config.length, 0.0)
    back = jax.random.bernoulli(way)
    begin = jnp.where(back, path.length - begin, begin)
    steps = jnp.arange(config.frames) * (config.speed / config.rate) * jnp.where(back, -1.0, 1.0)
    return steps[:, None] * path.direction, path.start + begin * path.direction


def _degraded(panorama: Panorama, poses: jax.Array, config: PairConfig, buffers: Buffers) -> tuple[Video, jax.Array]:
    """The video, and the buffers (4,) that it called for: it is whole where `buffers` are as large."""
    distance = complete_distance(panorama, config=config.depth)
    everywhere = jnp.ones(panorama.valid.shape, bool)
    placed = Panorama(panorama.rgb, distance, everywhere)  # what has no distance has a colour
    scene = lift(placed, level_pose(jnp.zeros(3)), everywhere, config=config.lift)

    def frame_at(pose):
        camera = equirectangular_camera(pose, config.height)
        frame = rasterize(scene, camera, config=config.rasterize, buffers=buffers)
        rgb = safe_divide(frame.rgb, frame.alpha[..., None])
        return jnp.clip(rgb, 0, 1), frame.alpha, frame.distance, frame.needed

    rgb, alpha, distance, needed = jax.lax.map(frame_at, poses)
    return Video(rgb, alpha, distance, poses), needed.max(axis=0)


def _fitting(panorama: Panorama, poses: jax.Array, config: PairConfig) -> tuple[Video, jax.Array]:
    buffers = pair_buffers(config)
    while True:
        video, needed = _degraded_compiled(panorama, poses, config, buffers)
        if buffers.hold(needed):
            return video, needed
        buffers = buffers.enlarged(needed)


def _seen(render: PanoramaTracer, position: jax.Array, rows: int) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Colour, distance, and where the distance is known."""
    rgb, distance = (jnp.asarray(x) for x in render(level_pose(position), rows))
    return rgb, distance, distance > 0


def _clean(rgb: jax.Array, distance: jax.Array, offsets: jax.Array) -> Video:
    return Video(rgb, jnp.ones(distance.shape), distance, level_pose(offsets))


def pair_buffers(config: PairConfig) -> Buffers:
    """The rasterizer's buffers that most clips fit: a function of the config alone, since sums over buffers of other
    sizes round otherwise, and a clip's bytes may not depend on those before it."""
    splats = 2 * config.source_rows**2
    tiles = 2 * (config.height // config.rasterize.tile) ** 2
    pairs = 3 * splats + 90 * tiles  # measured at 128 and 256 source rows: 2.7 splats + 82 tiles
    sizes = (splats, 3 * splats // 2 + 20 * tiles, pairs, pairs // config.rasterize.chunk + tiles)
    return Buffers(*map(bucket, sizes))


_room_pair = jax.jit(room_pair, static_argnames=("config", "buffers"))
_degraded_compiled = jax.jit(_degraded, static_argnames=("config", "buffers"))
