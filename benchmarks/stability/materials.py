"""Regimes of what things are made of: glass, black things that give a sensor nothing back, patterns that repeat. In
rooms made to measure."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.stability.case import Case, case_of, figures_of, traced
from benchmarks.stability.given_distance import compare
from benchmarks.stability.methods import ours
from benchmarks.stability.places import thrown_back
from benchmarks.stability.regime import SEEN, WHOLE, Figures, Regime
from benchmarks.stability.stage import FIRST_PIECE, Stage, scattered, staged_room
from rein3d_jax.geometry.sphere import pixel_rays
from rein3d_jax.pipeline.stages import origin_pose
from rein3d_jax.rooms.model import Room
from rein3d_jax.scene import Panorama

AT_GLASS = "ours, distance at the glass"
_PANE = 1.2  # metres ahead of the camera, two across
_PIECES = 16  # that stand about
_BLACK_ROW = 6  # of textures: a door's, and there is no door
_SHELL_ROWS = slice(0, 6)
_SOOT = 0.005  # linear


def _behind_glass(percent: float, seed: int) -> dict[str, Figures]:
    """A pane from floor to ceiling that throws back a share of the light: the picture shows both, and the distance is
    that of what stands behind, or of the glass."""
    stage = scattered(8, seed)
    clear = tuple(box for box in stage.boxes if abs(box[0][0] - _PANE) > box[1][0] + 0.05)
    room = staged_room(replace(stage, boxes=clear), seed)
    case, share = case_of(room), percent / 100
    rgb, pane = _glazed(room, case.true, np.zeros(3), share)
    views = []
    for view in case.views:
        seen = Panorama(view.rgb, view.distance, view.distance > 0)
        views.append(replace(view, rgb=_glazed(room, seen, view.true_pose[:3, 3], share)[0]))
    behind = replace(case, views=views).spoiled(lambda panorama: replace(panorama, rgb=rgb))
    on_it = behind.spoiled(lambda panorama: replace(panorama, distance=jnp.minimum(panorama.distance, pane)))
    return compare(behind) | {AT_GLASS: figures_of(on_it, ours(on_it.given))}


def _glazed(room: Room, panorama: Panorama, place, share: float) -> tuple[jax.Array, jax.Array]:
    """What is seen from `place` (3,) through the pane, and the distance (h, w) to it, infinite beside it."""
    rays, place = pixel_rays(*panorama.distance.shape), jnp.asarray(place, jnp.float32)
    along = jnp.where(jnp.abs(rays[..., 0]) < 1e-6, 1e-6, rays[..., 0])
    reach = (_PANE - place[0]) / along
    points = place + rays * reach[..., None]
    crossed = (reach > 0) & (reach < panorama.distance) & (jnp.abs(points[..., 1]) < 1)
    points = jnp.where(crossed[..., None], points, place)
    both = (1 - share) * panorama.rgb + share * thrown_back(room, points, rays)
    return jnp.where(crossed[..., None], both, panorama.rgb), jnp.where(crossed, reach, jnp.inf)


def _black(count: float, seed: int) -> dict[str, Figures]:
    """Some of the boxes are black, and nothing is known of their distance."""
    room, black = staged_room(scattered(_PIECES, seed), seed), int(count)
    texture = jnp.where(jnp.arange(len(room.boxes.texture)) < black, _BLACK_ROW, room.boxes.texture)
    soot = room.textures.replace(ramp=room.textures.ramp.at[_BLACK_ROW].set(_SOOT))
    case: Case = case_of(room.replace(boxes=room.boxes.replace(texture=texture), textures=soot))
    named = traced(room, origin_pose(), height=len(case.given.rgb)).object
    lost = (named >= FIRST_PIECE) & (named < FIRST_PIECE + black)
    return compare(case.spoiled(lambda panorama: replace(panorama, valid=panorama.valid & ~lost)))


def _patterned(centimetres: float, seed: int) -> dict[str, Figures]:
    """All walls, floor and ceiling in one grid of lines, so many centimetres apart."""
    room = staged_room(scattered(8, seed, Stage()), seed)
    period, textures = centimetres / 100, room.textures
    grid = {"cell": period, "joint": 0.3 * period, "joint_shade": 0.35, "shift": 0.0, "contrast": 0.0, "variation": 0.0}
    changed = {name: getattr(textures, name).at[_SHELL_ROWS].set(value) for name, value in grid.items()}
    return compare(case_of(room.replace(textures=textures.replace(**changed))))


REGIMES = (
    Regime("glass", "a ghost on what is behind it", "% that it throws back", (0, 10, 20, 40, 80), 0, SEEN,
           _behind_glass, rows="9"),
    Regime("black furniture", "holes into the outside where a sofa stood", "boxes of 16 without distance",
           (0, 2, 4, 8, 16), 0, SEEN, _black, rows="8"),
    Regime("repeated texture", "moire", "centimetres from line to line", (5, 10, 20, 40, 80), 80, WHOLE, _patterned),
)  # fmt: skip
