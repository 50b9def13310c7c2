"""Make the training examples of the learned restorer: clips through drawn rooms, degraded and filled.

    python -m experiments.build_examples --config experiments/recipes/tiny_examples.toml [--set key=value ...]

Example i is a function of the seed and i. Killed and begun again, it goes on; a folder may be trained on while it is
being written.
"""

import argparse
import dataclasses
import sys
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from experiments.command import CommandParser
from experiments.config import load_config
from experiments.example_store import write_examples
from rein3d_jax.depth.shell_from_distance import shell_from_distance
from rein3d_jax.errors import InputError
from rein3d_jax.explore.chord import longest_chord
from rein3d_jax.explore.profile import ExploreConfig
from rein3d_jax.geometry.poses import rigid
from rein3d_jax.geometry.resample import sample_sphere
from rein3d_jax.geometry.sphere import pixel_rays, pixels_from_rays, world_from_camera_axes
from rein3d_jax.pipeline.pairs import PairConfig, degrade
from rein3d_jax.restore import background_of
from rein3d_jax.restore.background import Background
from rein3d_jax.restore.learned.candidates import clip_of
from rein3d_jax.restore.learned.loss import Example
from rein3d_jax.restore.learned.predict import halved_clip
from rein3d_jax.rooms.config import RoomConfig
from rein3d_jax.rooms.generate import room
from rein3d_jax.rooms.model import Room
from rein3d_jax.rooms.tracing.trace import trace
from rein3d_jax.scene import Panorama

_SCOUT = 32  # rows of the panoramas by which a walk is chosen and the shell found
_ATTEMPTS = 200  # rooms drawn for one walk


@dataclasses.dataclass(frozen=True)
class ExamplesConfig:
    output: str = "runs/examples"
    count: int = 1000
    seed: int = 0
    frames: int = 6  # of each walk, the anchor among them
    height: int = 128  # rows that are rendered and filled; half of them are stored
    shortest: float = 1.0  # metres walked
    longest: float = 3.0
    hidden: float = 0.02  # least share of the last frame that the anchor did not see: the rest has little to teach
    furnished: tuple[float, ...] = (0.2, 0.5, 0.9)  # rooms.furnished, in turns
    shell_support: float = 0.3  # as restore.shell_support: below it a room has no shell
    misplaced: float = 0.3  # share of examples whose shell's walls are off by up to 15 %
    explore: ExploreConfig = ExploreConfig(camera_radius=0.15, stop_buffer=0.15)
    rooms: RoomConfig = RoomConfig()

    def __post_init__(self):
        if self.frames < 2 or self.height % 32:
            raise InputError("frames must be at least 2 and height a multiple of 32")
        if not 0 < self.shortest <= self.longest:
            raise InputError("shortest must be above 0 and at most longest")


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0, or 2 with one line on stderr where the input is at fault."""
    parser = CommandParser("build_examples", __doc__)
    parser.add_recipe(ExamplesConfig, example="tiny_examples")
    return parser.run(_build, arguments)


def _build(options: argparse.Namespace) -> None:
    config = load_config(ExamplesConfig, options.config, options.set)
    for done in write_examples(config.output, partial(example, config=config), config.count):
        if done % 20 == 0 or done == config.count:
            print(f"{done}/{config.count} examples", flush=True)


def example(index: int, config: ExamplesConfig) -> Example:
    """Example `index` of a config, config.height / 2 rows. Raises InputError where no room has a walk that hides
    enough."""
    key = jax.random.fold_in(jax.random.key(config.seed), index)
    place, start, offsets, shell_key = _walk(key, index, config)
    looks = _trace(place, _pose(start[None]), config.height)
    source = Panorama(looks.rgb[0], looks.distance[0], looks.distance[0] > 0)
    video = degrade(source, _pose(offsets), config=PairConfig(height=config.height))
    background = _background(shell_key, place, start, source, config)
    clip = clip_of(video, observed=0.5, background=background)
    small = jax.tree.map(lambda x: x[0], _halved(jax.tree.map(lambda x: x[None], clip)))
    clean = _trace(place, _pose(start + offsets), config.height // 2)
    return jax.tree.map(np.asarray, Example(small, clean.rgb, clean.distance))


def _walk(key: jax.Array, index: int, config: ExamplesConfig):
    """(room, start (3,), places (t, 3) from there, a key for what is left to draw)."""
    rooms = dataclasses.replace(config.rooms, furnished=config.furnished[index % len(config.furnished)])
    for attempt in range(_ATTEMPTS):
        room_key, walk_key, rest = jax.random.split(jax.random.fold_in(key, attempt), 3)
        place = _room(room_key, rooms)
        start, offsets, hidden = _draw_walk(walk_key, place, config)
        if float(hidden) >= config.hidden:
            return place, start, offsets, rest
    raise InputError(f"none of {_ATTEMPTS} rooms has a walk of {config.shortest:g} m that uncovers {config.hidden:g}")


@partial(jax.jit, static_argnames="config")
def _draw_walk(key: jax.Array, place: Room, config: ExamplesConfig):
    """(start, places, share of the last frame that is hidden from the start; -1 where the path is too short)."""
    long, begin, way, steps = jax.random.split(key, 4)
    seen = trace(place, _pose(jnp.zeros(3)), _SCOUT).distance
    path = longest_chord(seen, seen > 0, config=config.explore)
    most = jnp.minimum(path.length, config.longest)
    length = jax.random.uniform(long, minval=config.shortest, maxval=jnp.maximum(most, config.shortest))
    first = jax.random.uniform(begin) * jnp.maximum(path.length - length, 0)
    back = jax.random.bernoulli(way)
    start = path.start + jnp.where(back, path.length - first, first) * path.direction
    parts = jnp.arange(1, config.frames) - jax.random.uniform(steps, (config.frames - 1,), maxval=0.5)
    along = jnp.concatenate([jnp.zeros(1), length * parts / (config.frames - 1)])
    offsets = along[:, None] * path.direction * jnp.where(back, -1.0, 1.0)
    hidden = _hidden(place, start, offsets[-1])
    return start, offsets, jnp.where(path.length < config.shortest, -1.0, hidden)


def _hidden(place: Room, start: jax.Array, offset: jax.Array) -> jax.Array:
    """Share of the pixels seen at start + offset that lie behind what is seen from start."""
    both = trace(place, _pose(jnp.stack([start, start + offset])), _SCOUT).distance
    both = jnp.where(both > 0, both, 100.0)
    points = offset + both[1][..., None] * pixel_rays(*both.shape[1:])
    inverse = sample_sphere(1 / both[0][..., None], *pixels_from_rays(points, *both.shape[1:]))[..., 0]
    return jnp.mean(jnp.linalg.norm(points, axis=-1) * inverse > 1.15)


def _background(key: jax.Array, place: Room, start: jax.Array, source: Panorama, config) -> Background | None:
    """The shell as the main job finds it, or off: what is trained on walls that fit trusts them blindly."""
    seen = _trace(place, _pose(start), _SCOUT)
    shell, support = shell_from_distance(Panorama(seen.rgb, seen.distance, seen.distance > 0))
    if float(support) < config.shell_support:
        return None
    off, by = jax.random.split(key)
    scale = jax.random.uniform(by, (4,), minval=-0.15, maxval=0.15) * jax.random.bernoulli(off, config.misplaced)
    return background_of(source, shell.replace(walls=shell.walls * (1 + scale)))


def _pose(position: jax.Array) -> jax.Array:
    return rigid(jnp.broadcast_to(world_from_camera_axes(), (*position.shape[:-1], 3, 3)), position)


_room = jax.jit(room, static_argnums=1)
_trace = jax.jit(trace, static_argnames="height")
_halved = jax.jit(halved_clip)

if __name__ == "__main__":
    sys.exit(main())
