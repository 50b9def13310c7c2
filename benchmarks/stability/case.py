"""A case: what a method is given of a room, and the true views that it is judged by.

Everything is in the frame of the panorama that is given, unless a name says `true`."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np

from experiments.evaluate.renderer import Renderer
from rein3d_jax.evaluate.coverage import coverage
from rein3d_jax.evaluate.regions import DISOCCLUDED, OBSERVED, regions_of_view
from rein3d_jax.evaluate.seam import seam_error
from rein3d_jax.explore.profile import ExploreConfig
from rein3d_jax.explore.trajectories import radial_trajectories
from rein3d_jax.geometry.poses import equirectangular_camera, rigid
from rein3d_jax.geometry.sphere import horizontal_direction, pixel_rays, pixel_solid_angles
from rein3d_jax.pipeline.stages import level_pose
from rein3d_jax.rooms.config import RoomConfig
from rein3d_jax.rooms.generate import generate_room
from rein3d_jax.rooms.model import Room
from rein3d_jax.rooms.tracing.trace import trace
from rein3d_jax.scene import Panorama

ROWS = 64  # of pictures: 8,192 Gaussians
WALKS = ExploreConfig(trajectories=3, camera_radius=0.1, stop_buffer=0.1, max_length=1.2)  # ends: where it is judged
CLOSED = RoomConfig(open_windows=0.0)
ASTRAY_FROM = 0.1  # of the true distance

traced = jax.jit(trace, static_argnames=("height", "samples"))
_drawn = jax.jit(generate_room, static_argnames="config")


@dataclass(frozen=True)
class View:
    """The truth from a place beside the input's, upright."""

    true_pose: jax.Array  # (4, 4) world_from_camera
    rgb: jax.Array  # (h, w, 3)
    distance: jax.Array  # (h, w) metres
    region: np.ndarray  # (h, w) of rein3d_jax.evaluate.regions


@dataclass(frozen=True)
class Case:
    """A panorama as it is given, as it truly is, and the views around it."""

    given: Panorama
    true: Panorama
    views: list[View]
    given_from_true: jax.Array  # (3, 3): the given panorama may lean

    def spoiled(self, spoil: Callable[[Panorama], Panorama]) -> "Case":
        """The case whose panorama came out otherwise."""
        return replace(self, given=spoil(self.given))

    def pose_of(self, view: View) -> jax.Array:
        """world_from_camera (4, 4) of a view."""
        turn = rigid(self.given_from_true, jnp.zeros(3))
        return jnp.matmul(turn, view.true_pose, precision="highest")


def drawn_room(seed: int) -> Room:
    """A furnished room, its windows closed: every distance is known."""
    return _drawn(jax.random.fold_in(jax.random.key(31), seed), config=CLOSED)


def panorama_at(room: Room, place=(0.0, 0.0, 0.0), rows: int = ROWS) -> Panorama:
    """The true panorama at `place` (3,) of the room's frame."""
    seen = traced(room, level_pose(jnp.asarray(place, jnp.float32)), height=rows)
    return Panorama(seen.rgb, seen.distance, seen.distance > 0)


def case_of(room: Room, ends=None) -> Case:
    """A room seen from its origin, judged at the places `ends` (n, 3); without, at the ends of its three ways."""
    true = panorama_at(room)
    if ends is None:
        paths = radial_trajectories(true, config=WALKS)
        ends = np.asarray(horizontal_direction(paths.directions) * paths.lengths[:, None])
    return Case(true, true, [view_at(room, end, true) for end in ends], jnp.eye(3))


def view_at(room: Room, place, true: Panorama) -> View:
    """The view from `place` (3,), of a room whose input is `true`."""
    seen, origin = panorama_at(room, place), jnp.asarray(place, jnp.float32)
    region = regions_of_view(true, origin, pixel_rays(*seen.distance.shape), seen.distance)
    return View(level_pose(origin), seen.rgb, seen.distance, np.asarray(region))


def figures_of(case: Case, render: Renderer) -> dict[str, float]:
    """What a method makes of a case, meaned over its views: PSNR of all, of what the input saw, of what it did not, and
    of the `caps` at the poles; `seam`, the excess of its jump, levels of 255; `coverage`; `distance`, the mean relative
    error where something is shown, and `astray`, the share of it beyond ASTRAY_FROM."""
    backdrop = jnp.mean(case.given.rgb, axis=(0, 1))
    rows = []
    for view in case.views:
        camera = equirectangular_camera(case.pose_of(view), len(view.rgb))
        rows.append(view_figures(view, *render(camera), backdrop))
    return {key: _mean([row[key] for row in rows]) for key in rows[0]}


def _mean(values: list[float]) -> float:
    """Of those that are there; NaN of none."""
    known = [value for value in values if not np.isnan(value)]
    return float(np.mean(known)) if known else float("nan")


def view_figures(view: View, rgb, alpha, distance, backdrop) -> dict[str, float]:
    """Figures of one view."""
    picture = jnp.clip(rgb * alpha[..., None] + (1 - alpha[..., None]) * backdrop, 0, 1)
    squared = np.asarray(jnp.mean((picture - view.rgb) ** 2, axis=-1), np.float64)
    shown = np.asarray((alpha > 0.5) & (view.distance > 0))
    off = np.abs(np.asarray(distance) / np.maximum(np.asarray(view.distance), 1e-6) - 1)
    area = np.broadcast_to(np.asarray(pixel_solid_angles(*shown.shape)), shown.shape)
    weights = area * shown / max((area * shown).sum(), 1e-9)
    return {
        "psnr": _decibels(squared, area),
        "seen": _decibels(squared, area * (view.region == OBSERVED)),
        "hidden": _decibels(squared, area * (view.region == DISOCCLUDED)),
        "caps": _decibels(squared, area * _in_caps(area.shape)),
        "seam": abs(float(seam_error(picture) - seam_error(view.rgb))),
        "coverage": float(coverage(alpha)),
        "distance": float((weights * np.minimum(off, 10.0)).sum()),
        "astray": float((weights * (off > ASTRAY_FROM)).sum()),
    }


def _in_caps(shape: tuple[int, int]) -> np.ndarray:
    """Pixels (h, w) within 20 degrees of a pole."""
    height, _ = shape
    row = np.abs((np.arange(height) + 0.5) / height - 0.5) * 180
    return np.broadcast_to((row > 70)[:, None], shape)


def _decibels(squared: np.ndarray, weights: np.ndarray) -> float:
    """PSNR of squared errors; NaN where nothing counts."""
    if (weights > 0).sum() < 16:  # pixels: a handful is chance
        return float("nan")
    return float(-10 * np.log10(max((squared * weights).sum() / weights.sum(), 1e-6)))
