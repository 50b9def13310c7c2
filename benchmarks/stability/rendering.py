"""Regimes of the renderer: poles, the seam, other sizes and distances, units, a turning camera, small buffers."""

from dataclasses import replace
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.poles import footprint_errors
from benchmarks.stability.case import ROWS, Case, View, case_of, drawn_room, figures_of, traced, view_at
from benchmarks.stability.given_distance import compare, furnished
from benchmarks.stability.given_picture import seen_at_rows
from benchmarks.stability.methods import BALLS, CLASSIC, METHODS, lifted_by, peeled, splats
from benchmarks.stability.regime import LARGE, OURS, SMALL, WHOLE, Figure, Figures, Regime
from benchmarks.stability.stage import EYE, Stage, scattered, staged_room
from experiments.evaluate.renderer import Renderer
from rein3d_jax.evaluate.flicker import flicker
from rein3d_jax.geometry.poses import equirectangular_camera, pinhole_camera, upright
from rein3d_jax.geometry.resample import perspective_crop
from rein3d_jax.geometry.safe import safe_divide
from rein3d_jax.pipeline.stages import level_pose
from rein3d_jax.rasterize import Buffers, RasterizeConfig, allocate, rasterize

DRAWING = ("ours", "balls", "mesh")  # that differ where only rendering does
_FOOTPRINT = Figure("footprint", "error of a footprint's second moments", SMALL, 0.05)
_SEAM = Figure("seam", "jump at the seam over its neighbours', levels of 255", SMALL, 2.0)
_CAPS = Figure("caps", "PSNR within 20 degrees of the poles, dB", LARGE, 3.0)
_TREMBLING = Figure("flicker", "errors' change, levels of 255 a degree", SMALL, 3.0)
_FRAMES, _SIDE = 5, 64


def _pole(latitude: float, seed: int) -> dict[str, Figures]:
    """A disc of a tenth of its distance."""
    row = footprint_errors(latitude, 0.1, seed)
    return {OURS: {"footprint": row["ours"]}, "plain EWA": {"footprint": min(row["plain_ewa"], 1.0)}}


@cache
def _renderers(seed: int) -> dict[str, Renderer]:
    return {name: METHODS[name](furnished(seed).given) for name in DRAWING}


def _magnified(times: float, seed: int) -> dict[str, Figures]:
    """The same scene in smaller and larger pictures; the truth has rays enough for a small one's pixels."""
    rows = int(ROWS * times)
    case = furnished(seed)
    views = [_resized(drawn_room(seed), view, rows) for view in case.views]
    return {name: figures_of(replace(case, views=views), render) for name, render in _renderers(seed).items()}


def _resized(room, view: View, rows: int) -> View:
    seen = traced(room, view.true_pose, height=rows, samples=max(ROWS // rows, 1))
    return View(view.true_pose, seen.rgb, seen.distance, np.zeros(seen.distance.shape, int))


def _closer(times: float, seed: int) -> dict[str, Figures]:
    """A wall 2 m before the input, seen from so many times nearer."""
    stage = scattered(6, seed, Stage((7.0, 5.0, 2.6), (1.5, 0.0, EYE)))
    clear = tuple(box for box in stage.boxes if box[0][0] < 0.5 and abs(box[0][1]) > box[1][1] + 0.2)
    room = staged_room(replace(stage, boxes=clear), seed)
    case = case_of(room, [])
    view = view_at(room, jnp.array([2.0 - 2.0 / times, 0.0, 0.0]), case.true)
    return compare(replace(case, views=[view]))


def _in_units(unit: float, seed: int) -> dict[str, Figures]:
    """All lengths times `unit`: what a map in other units than metres comes to."""
    case = furnished(seed)
    given = replace(case.given, distance=case.given.distance * unit)
    views = [replace(view, distance=view.distance * unit, true_pose=level_pose(view.true_pose[:3, 3] * unit))
             for view in case.views]  # fmt: skip
    return compare(replace(case, given=given, views=views))


def _turning(step: float, seed: int) -> dict[str, Figures]:
    """A camera that turns by `step` degrees a frame: how much its errors change from frame to frame, over the step.
    What pops changes at once: its figure grows without bound as steps become small."""
    place = furnished(seed).views[0].true_pose[:3, 3]
    wide = traced(drawn_room(seed), level_pose(place), height=4 * ROWS)
    yaws = np.radians(step) * np.arange(_FRAMES)
    cameras = [pinhole_camera(upright(place, yaw), _SIDE, np.radians(70)) for yaw in yaws]
    truth = jnp.stack([_cropped(wide.rgb, level_pose(place), camera) for camera in cameras])
    found = {}
    for name, render in _renderers(seed).items():
        frames = jnp.stack([picture.rgb * picture.alpha[..., None] for picture in map(render, cameras)])
        found[name] = {"flicker": 255 * float(flicker(frames - truth)) / step}
    return found


_cropped = jax.jit(perspective_crop)


@cache
def _overfull(seed: int) -> tuple:
    case = furnished(seed)
    scene, camera = peeled(case.given), equirectangular_camera(case.views[0].true_pose, ROWS)
    return case, scene, camera, allocate(scene, [camera], config=RasterizeConfig(), slack=1.0)


def _in_buffers(share: float, seed: int) -> dict[str, Figures]:
    """Buffers of a share of what a view needs: as it is shown (`render` lets them grow), and as it would be, silently
    cut; `overflow` is what `rasterize` confesses."""
    case, scene, camera, needed = _overfull(seed)
    view: Case = replace(case, views=case.views[:1])
    small = Buffers(*(max(int(size * share), 64) for size in needed))
    frame = rasterize(scene, camera, config=RasterizeConfig(), buffers=small)
    cut = figures_of(view, lambda _: (safe_divide(frame.rgb, frame.alpha[..., None]), frame.alpha, frame.distance))
    whole = figures_of(view, _renderers(seed)["ours"])
    return {OURS: whole, "buffers that do not grow": cut | {"overflow": float(frame.overflow)}}


def _in_bits(bits: float, seed: int) -> dict[str, Figures]:
    """Numbers of the scene with so many bits after the first: 7 are bfloat16's, 10 float16's, 23 float32's. The places
    alone keep theirs."""
    case = furnished(seed)
    ours, balls = peeled(case.given), lifted_by(case.given, BALLS)
    found = {OURS: (ours, ours.means, RasterizeConfig()), "ours, places too": (ours, None, RasterizeConfig())}
    found |= {"balls": (balls, balls.means, CLASSIC)}
    shown = {}
    for name, (scene, places, raster) in found.items():
        coarse = jax.tree.map(lambda x: _rounded(x, int(bits)) if x.dtype == jnp.float32 else x, scene)
        shown[name] = figures_of(case, splats(coarse if places is None else coarse.replace(means=places), raster))
    return shown


def _rounded(x: jax.Array, bits: int) -> jax.Array:
    mantissa, exponent = jnp.frexp(x)
    return jnp.ldexp(jnp.round(mantissa * 2.0 ** (bits + 1)) / 2.0 ** (bits + 1), exponent)


REGIMES = (
    Regime("poles", "a star at the zenith", "degrees of latitude", (0, 45, 75, 85, 89, 89.9), 0, _FOOTPRINT, _pole,
           seeds=1, rows="1"),
    Regime("pole rows", "carpets smeared below the camera", "rows, seen at 64", (16, 32, 64, 128, 256), 64, _CAPS,
           seen_at_rows, seeds=2, rows="5"),
    Regime("seam", "a line behind the camera", "rows, seen at 64", (16, 32, 64, 128, 256), 64, _SEAM, seen_at_rows,
           seeds=2, rows="4"),
    Regime("other sizes", "holes when near, shimmer when small", "times the rows", (0.25, 0.5, 1, 2, 4), 1, WHOLE,
           _magnified, seeds=2, rows="26"),
    Regime("nearer and farther", "gaps in a wall, fog", "times nearer", (0.5, 1.25, 2, 4, 8), 1.25, WHOLE, _closer,
           rows="26"),
    Regime("units", "nothing at all", "metres times", (0.001, 0.01, 0.1, 1, 10, 100, 1000), 1, WHOLE, _in_units,
           seeds=1, rows="7"),
    Regime("turning", "popping", "degrees a frame", (0.1, 0.2, 0.5, 1, 2), 1, _TREMBLING, _turning, rows="29"),
    Regime("coarse numbers", "banding, and splats out of place", "bits of a mantissa", (2, 3, 5, 7, 10, 23), 23, WHOLE,
           _in_bits, rows="19"),
    Regime("small buffers", "tiles missing", "share of what is needed", (0.25, 0.5, 0.75, 0.9, 1), 1, WHOLE,
           _in_buffers, seeds=1, rows="14"),
)  # fmt: skip
