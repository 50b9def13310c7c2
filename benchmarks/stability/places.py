"""Regimes of the place: where the camera stands, how large the room is, and what stands in it. The distance is exact.
In rooms made to measure."""

from collections.abc import Callable
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.stability.case import case_of, figures_of, panorama_at, view_at
from benchmarks.stability.given_distance import compare
from benchmarks.stability.methods import ours_by_background
from benchmarks.stability.regime import COVERAGE, HIDDEN, SEEN, WHOLE, Figures, Regime
from benchmarks.stability.stage import EYE, Stage, partitioned, scattered, staged_case, staged_room
from rein3d_jax.geometry.resample import sample_sphere
from rein3d_jax.geometry.sphere import pixel_rays, pixels_from_rays
from rein3d_jax.rooms.model import Room
from rein3d_jax.scene import Panorama

_PIECES = 8  # that stand about where nothing else is said


def _on(stage_of: Callable[[float, int], Stage]) -> Callable[[float, int], dict[str, Figures]]:
    return lambda severity, seed: compare(staged_case(stage_of(severity, seed), seed))


def _furnished(seed: int, **changed) -> Stage:
    return scattered(_PIECES, seed, replace(Stage(), **changed))


def _at_height(height: float, seed: int) -> Stage:
    return _furnished(seed, camera=(0.0, 0.0, height))


def _near_wall(gap: float, seed: int) -> Stage:
    return _furnished(seed, camera=(Stage().size[0] / 2 - gap, 0.0, EYE))


def _sized(side: float, seed: int) -> Stage:
    """Square, with pieces in proportion."""
    height, scale = min(max(0.6 * side, 2.0), 6.0), side / 5
    pieces = scattered(_PIECES, seed, Stage((5.0, 5.0, 2.6)))
    boxes = tuple(tuple(tuple(x * min(scale, 1.5) if i == 2 else x * scale for i, x in enumerate(part)) for part in box)
                  for box in pieces.boxes)  # fmt: skip
    return Stage((side, side, height), (0.0, 0.0, EYE), boxes)


def _corridor(aspect: float, seed: int) -> Stage:
    return Stage((1.6 * aspect, 1.6, 2.6))


def _thin(width: float, seed: int) -> dict[str, Figures]:
    """Thirty posts; widths in centimetres."""
    return compare(staged_case(scattered(30, seed, width=width / 100), seed))


def _plain(percent: float, seed: int) -> dict[str, Figures]:
    """All colours drawn towards their mean by a share."""
    case = staged_case(_furnished(seed), seed)
    mean = jnp.mean(case.given.rgb, axis=(0, 1))

    def fade(rgb):
        return mean + (1 - percent / 100) * (rgb - mean)

    views = [replace(view, rgb=fade(view.rgb)) for view in case.views]
    case = replace(case, views=views).spoiled(lambda panorama: replace(panorama, rgb=fade(panorama.rgb)))
    return compare(case) | {"ours, no network": figures_of(case, ours_by_background(case.given))}


def _mirrored(percent: float, seed: int) -> dict[str, Figures]:
    """A share of the wall ahead is a mirror: it shows the room beyond itself, its distance is the glass'."""
    stage = _furnished(seed)
    glass = stage.size[0] / 2 - stage.camera[0]
    room, across = staged_room(stage, seed), 2 * np.sqrt(percent / 100)
    case = case_of(room)

    def reflect(panorama: Panorama, place) -> Panorama:
        """What the mirror throws back: the room as it is seen from the place's mirror image, from within."""
        rays = pixel_rays(*panorama.distance.shape)
        points = jnp.asarray(place) + rays * panorama.distance[..., None]
        on_wall = jnp.abs(points[..., 0] - glass) < 0.01
        frame = jnp.abs(points[..., 1]) < across * stage.size[1] / 4
        frame &= jnp.abs(points[..., 2] + EYE - stage.size[2] / 2) < across * stage.size[2] / 4
        back = thrown_back(room, points, rays)
        return replace(panorama, rgb=jnp.where((on_wall & frame)[..., None], 0.9 * back, panorama.rgb))

    given = reflect(case.true, jnp.zeros(3))
    views = []
    for view in case.views:
        seen = Panorama(view.rgb, view.distance, view.distance > 0)
        views.append(replace(view, rgb=reflect(seen, view.true_pose[:3, 3]).rgb))
    return compare(replace(case, given=given, views=views))


def thrown_back(room: Room, points: jax.Array, rays: jax.Array) -> jax.Array:
    """Colours (h, w, 3) that rays (h, w, 3), thrown back at `points` (h, w, 3) of the wall ahead, meet on the empty
    room's other walls: sampled of the empty room's panorama at the camera, which sees them all."""
    bare = room.replace(boxes=room.boxes.replace(count=jnp.int32(0)))
    panorama = panorama_at(bare)
    back = rays * jnp.array([-1.0, 1.0, 1.0])
    reach = jnp.where(back > 0, room.high - points, room.low - points) / jnp.where(jnp.abs(back) < 1e-6, 1e-6, back)
    reach = jnp.min(jnp.where(reach > 1e-3, reach, jnp.inf), axis=-1)
    hit = points + jnp.where(jnp.isfinite(reach), reach, 0.0)[..., None] * back
    return sample_sphere(panorama.rgb, *pixels_from_rays(hit, *panorama.rgb.shape[:2]))


def _away(metres: float, seed: int) -> dict[str, Figures]:
    """One view, `metres` from the input along the longest way."""
    stage = scattered(_PIECES, seed, Stage((8.0, 4.0, 2.6), (-3.2, 0.0, EYE)))
    clear = tuple(box for box in stage.boxes if abs(box[0][1]) > box[1][1] + 0.3)
    room = staged_room(replace(stage, boxes=clear), seed)
    case = case_of(room)
    case = replace(case, views=[view_at(room, jnp.array([metres, 0.0, 0.0]), case.true)])
    return compare(case)


REGIMES = (
    Regime("camera's height", "table tops that are missing, floors that are coarse", "metres above the floor",
           (0.4, 0.8, 1.2, 1.6, 2.0, 2.4), 1.6, WHOLE, _on(_at_height)),
    Regime("camera near a wall", "a wall of a few huge splats", "metres to it", (0.3, 0.45, 0.6, 1.0, 1.5), 1.5, WHOLE,
           _on(_near_wall)),
    Regime("size of the room", "no way to go; or mush far away", "metres a side", (1.2, 2.5, 5, 10, 20), 5, WHOLE,
           _on(_sized)),
    Regime("corridor", "an end that is mush", "length over width", (1, 2, 4, 8, 16), 1, WHOLE, _on(_corridor)),
    Regime("rooms through doors", "the next room is a stub", "rooms in a row", (2, 3, 4, 5, 6), 2, HIDDEN,
           _on(lambda rooms, seed: partitioned(int(rooms)))),
    Regime("clutter", "things' backs, and the wall behind them", "boxes on the floor", (0, 4, 8, 16, 32), 0, COVERAGE,
           _on(lambda count, seed: scattered(int(count), seed))),
    Regime("thin things", "legs that dissolve", "centimetres wide, thirty of them", (1, 2, 4, 8, 16), 16, SEEN, _thin),
    Regime("plain walls", "the same, with less to see", "% of all contrast gone", (0, 50, 75, 90, 97), 0, WHOLE, _plain,
           rows="10"),
    Regime("mirror", "a picture glued onto the glass", "% of the wall ahead", (0, 10, 25, 50, 100), 0, SEEN, _mirrored,
           rows="9"),
    Regime("way from the input", "it falls apart as one walks", "metres", (0.25, 0.5, 1, 2, 4, 6), 0.25, WHOLE, _away,
           rows="24"),
)  # fmt: skip
