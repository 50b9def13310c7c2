"""Examples from drawn rooms that are made while training: pure functions of a key, for jit and vmap.

Two kinds: peeled, the panorama with what stands in the room taken away (rein3d_jax.peel), whose truth is the empty room
under the same light; walked, frames from beside the panorama that show what it saw of them, as if lifted without a
fault. A walk through the rasterizer itself (experiments.build_examples) costs ten times as much."""

from functools import partial

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.morphology import window_range
from rein3d_jax.geometry.poses import rigid
from rein3d_jax.geometry.pyramid import halve
from rein3d_jax.geometry.resample import sample_sphere
from rein3d_jax.geometry.shell import RoomShell
from rein3d_jax.geometry.sphere import (
    azimuths,
    horizontal_direction,
    pixel_rays,
    pixels_from_rays,
    world_from_camera_axes,
)
from rein3d_jax.peel import without_things
from rein3d_jax.restore.background import background_of
from rein3d_jax.restore.learned.candidates import Anchor, frame_candidates, positions
from rein3d_jax.restore.learned.condition import Clip
from rein3d_jax.restore.learned.loss import Example
from rein3d_jax.restore.learned.predict import halved_clip
from rein3d_jax.rooms.config import RoomConfig
from rein3d_jax.rooms.generate import generate_room
from rein3d_jax.rooms.model import Room
from rein3d_jax.rooms.tracing.trace import trace
from rein3d_jax.rooms.tracing.visible import visible
from rein3d_jax.scene import Panorama, Video

_ROWS = 128  # traced; half are learned from
_FAR = 10.0  # times the median distance: where the main job places what has none (depth.far)
_CLEARANCE = 0.35  # metres that a place keeps from what the panorama saw
_FARTHEST = 3.0  # metres from the panorama
_MISPLACED = 0.3  # share of examples whose shell's walls are off,
_OFF = 0.15  # by so much at most
_SCOUT = 32  # rows of the panorama by which places are chosen
_LOOKS = 3  # places from which the empty room is looked at: what none of them sees need not be known
_UNSEEN_COUNTS = 0.1  # of a pixel that none of them sees


def peeled_and_walked(key: jax.Array, rooms: RoomConfig, frames: int) -> tuple[Example, Example]:
    """Examples of one room: peeled (2, _ROWS / 2, _ROWS), the panorama and the room without its things; and walked
    (frames, _ROWS / 2, _ROWS), the panorama and what it shows of frames from places beside it."""
    room_key, shell_key, walk_key, look_key = jax.random.split(key, 4)
    room = generate_room(room_key, rooms)
    scout = _complete(trace(room, _poses(jnp.zeros(3)), _SCOUT).distance)
    places = _places(walk_key, scout, frames - 1)
    # One program each for what is costly to compile: tracing, visibility, fills.
    poses = _poses(jnp.concatenate([jnp.zeros((1, 3)), places]))
    seen = trace(room, poses, _ROWS)
    empty = trace(room, poses[0], _ROWS, things=False)
    rgb, empty_rgb = seen.rgb, empty.rgb
    distance, empty_distance = (_complete(x.distance) for x in (seen, empty))
    rays = pixel_rays(_ROWS, 2 * _ROWS)
    looks = _places(look_key, scout, _LOOKS)
    points = jnp.concatenate([
        places[:, None, None] + distance[1:, ..., None] * rays,
        jnp.broadcast_to(empty_distance[..., None] * rays, (_LOOKS, *rays.shape)),
    ])  # fmt: skip
    origins = jnp.concatenate([jnp.zeros_like(places), looks])
    met = jax.vmap(partial(visible, room))(origins, points)
    source = Panorama(rgb[0], distance[0], seen.distance[0] > 0)
    shell = _shell(shell_key, room)
    taken = without_things(source, shell, poses[0], rows=_ROWS)
    shown_rgb, shown = jax.vmap(partial(_shown, source))(points[: frames - 1], met[: frames - 1])
    video = Video(
        jnp.concatenate([rgb[:1], shown_rgb, taken.rgb[1:]]),
        jnp.concatenate([taken.alpha[:1], shown, taken.alpha[1:]]),
        jnp.concatenate([distance[:1], distance[1:] * shown, taken.distance[1:]]),
        jnp.concatenate([poses, poses[:1]]),
    )
    clip = _clip(video, Anchor(background_of(source, shell), distance[0], poses[0]))
    counts = jnp.where(jnp.any(met[frames - 1 :], axis=0), 1.0, _UNSEEN_COUNTS)
    clean = jnp.concatenate([rgb, empty_rgb[None]]), jnp.concatenate([distance, empty_distance[None]])
    whole = _halved(clip, *clean, jnp.ones((frames + 1, _ROWS, 2 * _ROWS)).at[-1].set(counts))
    return tuple(jax.tree.map(lambda x, at=at: x[at], whole) for at in (jnp.array([0, frames]), slice(0, frames)))


def _clip(video: Video, anchor: Anchor) -> Clip:
    """`clip_of`, its frames side by side."""
    frames = video.rgb, video.distance, video.alpha >= 0.5, video.world_from_camera
    rgb, distance = jax.vmap(lambda *frame: frame_candidates(*frame, anchor))(*frames)
    return Clip(video.rgb, video.alpha, video.distance, rgb, distance, positions(video.world_from_camera))


def _complete(distance: jax.Array) -> jax.Array:
    """Distances (..., h, w) with what has none far away, as the main job places it."""
    known = jnp.where(distance > 0, distance, jnp.nan)
    return jnp.where(distance > 0, distance, _FAR * jnp.nanmedian(known, axis=(-2, -1), keepdims=True))


def _shown(source: Panorama, points: jax.Array, seen: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Colour (h, w, 3) and alpha (h, w) of a frame, of what the panorama saw of it, its holes a pixel wider."""
    alpha, _ = window_range(seen.astype(jnp.float32))
    rgb = sample_sphere(source.rgb, *pixels_from_rays(points, _ROWS, 2 * _ROWS))
    return rgb * alpha[..., None], alpha


def _places(key: jax.Array, distance: jax.Array, count: int) -> jax.Array:
    """Places (count, 3) that the panorama saw to be free, at its own height."""
    which, far = jax.random.split(key)
    columns = jax.random.randint(which, (count,), 0, distance.shape[1])
    band = distance[distance.shape[0] * 2 // 5 : distance.shape[0] * 3 // 5].min(axis=0)
    least = jnp.minimum(jnp.minimum(band, jnp.roll(band, 2)), jnp.roll(band, -2))  # to both sides, too
    reach = jnp.clip(least[columns] - _CLEARANCE, 0.0, _FARTHEST)
    way = reach * jnp.sqrt(jax.random.uniform(far, (count,), minval=0.05))
    return way[:, None] * horizontal_direction(azimuths(distance.shape[1])[columns])


def _shell(key: jax.Array, room: Room) -> RoomShell:
    """The room's own, or off: a network trained on walls that fit trusts them blindly."""
    off, by = jax.random.split(key)
    walls = jnp.stack([room.high[0], room.high[1], -room.low[0], -room.low[1]])
    scale = jax.random.uniform(by, (4,), minval=-_OFF, maxval=_OFF) * jax.random.bernoulli(off, _MISPLACED)
    return RoomShell(room.yaw, walls * (1 + scale), -room.low[2], room.high[2])


def _poses(position: jax.Array) -> jax.Array:
    return rigid(jnp.broadcast_to(world_from_camera_axes(), (*position.shape[:-1], 3, 3)), position)


def _halved(clip, rgb: jax.Array, distance: jax.Array, counts: jax.Array) -> Example:
    small = jax.tree.map(lambda x: x[0], halved_clip(jax.tree.map(lambda x: x[None], clip)))
    nearest = distance[:, ::2, ::2]  # between two surfaces there is nothing
    return Example(small, jax.vmap(halve)(rgb), nearest, jax.vmap(halve)(counts))
