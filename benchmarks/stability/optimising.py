"""Regimes of the optimiser, in tiny box rooms (benchmarks.studies.box_room), and of exploring in drawn ones.

ours            as the recipes refine: no Gaussian is added, no opacity reset
default, mcmc   3DGS' densification as gsplat has it, and Kheradmand et al.'s: the peers
"""

import hashlib
from collections import deque
from dataclasses import replace
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.stability.case import figures_of
from benchmarks.stability.given_distance import furnished
from benchmarks.stability.methods import METHODS, completed, small_restorer, splats, stages
from benchmarks.stability.regime import HIDDEN, LARGE, OURS, SMALL, Figure, Figures, Regime
from benchmarks.studies.box_room import (
    BOX,
    HEIGHT,
    Paint,
    lifted,
    pattern,
    pose_at,
    true_panorama,
    views_of,
    white,
)  # fmt: skip
from rein3d_jax.explore.trajectories import radial_trajectories
from rein3d_jax.geometry.poses import equirectangular_camera
from rein3d_jax.geometry.shell import meet_shell
from rein3d_jax.geometry.sphere import pixel_rays
from rein3d_jax.geometry.spherical_harmonics import C0
from rein3d_jax.pipeline.explore_and_restore import explore_and_restore
from rein3d_jax.pipeline.peel_scene import peel_scene
from rein3d_jax.pipeline.survey import Survey, lift_scene, room_background
from rein3d_jax.rasterize import Buffers, RasterizeConfig, render
from rein3d_jax.refine import Curves, DensifyConfig, RefineConfig, Views, ViewsConfig, first_snapshot, refine
from rein3d_jax.scene import Gaussians

# Evaluated, never fitted to.
NOVEL = [0.5 * np.array([np.cos(a), np.sin(a), 0.4 * np.cos(2 * a)]) for a in 0.5 + np.arange(3) * 2.1]
EXTENT = 2.0  # metres, about the median distance
RASTER = RasterizeConfig()
BUFFERS = Buffers(visible=4096, rows=16384, pairs=32768, chunks=2048)
_NEVER = 100_000
CONFIG = RefineConfig(
    steps=200, batch=2, evaluate_every=20, sh_degree=1, sh_degree_every=100, densification="none",
    views=ViewsConfig(size=32, held_out_every=8),
    densify=DensifyConfig(start=40, stop=160, every=40, reset_every=_NEVER),
)  # fmt: skip
KINDS = {
    OURS: CONFIG, "default": replace(CONFIG, densification="default"),
    "mcmc": replace(CONFIG, densification="mcmc", loss=replace(CONFIG.loss, opacity=0.01, scale=0.01)),
}  # fmt: skip
RESET_AT = 100
_OFF = Figure("mass", "share of opacity off the surface", SMALL, 0.05)
_HELD_OUT = Figure("psnr", "PSNR of held-out views, dB", LARGE, 3.0)
_TINT = Figure("tint", "red less blue, of what was guessed", SMALL, 0.05)
_DISTINCT = Figure("distinct", "different scenes so far", SMALL, 0.5)


def fit(scene: Gaussians, views: Views, config: RefineConfig, seed: int) -> tuple[Gaussians, Curves]:
    """`refine`, in the same buffers always."""
    start = first_snapshot(scene, views, extent=EXTENT, config=config, raster=RASTER)
    start = start.replace(buffers=jnp.array(BUFFERS.enlarged(start.buffers)))
    (last,) = deque(refine(start, views, jax.random.key(seed), config=config, raster=RASTER), maxlen=1)
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(last.scene)), "not finite"
    return last.scene, last.curves


def off_surface(scene: Gaussians) -> float:
    """Share of opacity x area that lies more than 5 % of the distance away from the wall."""
    away = jnp.linalg.norm(scene.means, axis=-1)
    wall, _ = meet_shell(BOX, jnp.zeros(3), scene.means / jnp.maximum(away, 1e-6)[:, None])
    first, second, _ = jnp.sort(jnp.exp(scene.log_scales), axis=-1)[:, ::-1].T
    mass = jnp.where(scene.alive, jax.nn.sigmoid(scene.opacity_logits) * first * second, 0.0)
    return float(jnp.sum(mass * (jnp.abs(away / wall - 1) > 0.05)) / jnp.sum(mass))


@cache
def _views(paint: Paint) -> Views:
    return views_of(paint, CONFIG.views)


def _white(percent: float, seed: int) -> dict[str, Figures]:
    """One flat colour, lifted with distances off by `percent`."""
    scene = lifted(white, noise=percent / 100)
    found = {name: fit(scene, _views(white), config, seed)[0] for name, config in KINDS.items()}
    return {name: {"mass": off_surface(g)} for name, g in ({"only lifted": scene} | found).items()}


@cache
def _run_of(kind: str, seed: int) -> dict[int, float]:
    """Held-out PSNR by step."""
    _, curves = fit(lifted(pattern), _views(pattern), KINDS[kind], seed)
    return {int(step): float(value) for step, value in curves.psnr}


def _after_steps(steps: float, seed: int) -> dict[str, Figures]:
    return {kind: {"psnr": _run_of(kind, seed)[int(steps)]} for kind in KINDS}


@cache
def _reset_run(seed: int) -> dict[int, float]:
    times = replace(CONFIG.densify, stop=CONFIG.steps, every=50, reset_every=RESET_AT)
    _, curves = fit(lifted(pattern), _views(pattern), replace(KINDS["default"], densify=times), seed)
    return {int(step): float(value) for step, value in curves.psnr}


def _since_reset(steps: float, seed: int) -> dict[str, Figures]:
    at = int(RESET_AT + steps)
    return {OURS: {"psnr": _run_of(OURS, seed)[at]}, "default, opacities reset": {"psnr": _reset_run(seed)[at]}}


def _into_slots(percent: float, seed: int) -> dict[str, Figures]:
    """Nearly all Gaussians want to grow, into free slots of a share of their number; who found none is counted."""
    scene = lifted(pattern, spare=percent / 100)
    eager = replace(KINDS["default"], densify=replace(CONFIG.densify, gradient=1e-7))
    _, curves = fit(scene, _views(pattern), eager, seed)
    grown = {"psnr": float(curves.psnr[-1, 1]), "overflow": float(curves.overflow)}
    return {OURS: {"psnr": _run_of(OURS, seed)[CONFIG.steps]}, "default, eager": grown}


@cache
def _digest(run: int) -> str:
    """Of the scene of one run, all of the same key."""
    scene, _ = fit(lifted(pattern), _views(pattern), KINDS["mcmc"], 0)
    return hashlib.sha256(b"".join(np.asarray(leaf).tobytes() for leaf in jax.tree.leaves(scene))).hexdigest()


def _again(runs: float, seed: int) -> dict[str, Figures]:
    """The same key, again. Of Brush five identical runs are published (its issue 525): five scenes."""
    distinct = len({_digest(run) for run in range(int(runs))})
    return {OURS: {"distinct": distinct}, "Brush, published": {"distinct": runs}}


def _tinted(levels: float, seed: int) -> dict[str, Figures]:
    """Row 25: guesses of two sources that disagree in colour; what the input did not see, the third behind, was filled
    with the redder one's."""
    away = jnp.abs(jnp.arctan2(*jnp.moveaxis(pixel_rays(HEIGHT, 2 * HEIGHT), -1, 0)[1::-1]))
    front = away < 2 * jnp.pi / 3
    tint = levels / 255 * jnp.array([1.0, 0.0, -1.0])
    scene = lifted(pattern)
    guessed = jnp.pad(~front.ravel(), (0, scene.alive.size - front.size))
    scene = scene.replace(sh=scene.sh + jnp.where(guessed[:, None, None], tint / C0, 0.0))
    views = views_of(pattern, CONFIG.views, tint=lambda source: tint * (source == 2),
                     weight=lambda source: 1.0 if source else front.astype(float))  # fmt: skip
    fitted, _ = fit(scene, views, CONFIG, seed)
    return {OURS: {"tint": _left(fitted)}, "not refined": {"tint": _left(scene)}}


def _left(scene: Gaussians) -> float:
    """Mean of red less blue error behind the camera, over NOVEL."""
    found, buffers = [], BUFFERS
    for place in NOVEL:
        frame, buffers = render(scene, equirectangular_camera(pose_at(place), HEIGHT), config=RASTER, buffers=buffers)
        error = frame.rgb - true_panorama(place, pattern)[0]
        found.append(jnp.mean((error[..., 0] - error[..., 2])[:, [*range(8), *range(-8, 0)]]))
    return float(abs(np.mean(found)))


@cache
def _explored(seed: int, peel: bool) -> list[Gaussians]:
    """The scene before any path, and after each."""
    config = stages()
    explore = replace(config.explore, trajectories=16, min_revealed=0.01 if peel else 0.0, max_length=1.5)
    config = replace(config, explore=explore)
    placed = completed(furnished(seed).given)
    background = room_background(placed, config.restore)
    restore = small_restorer(background)
    known = Survey(placed, lift_scene(placed, config.lift), radial_trajectories(placed, config=explore))
    if peel:
        known = known.replace(coarse=peel_scene(known, background, restore, jax.random.key(0), stages=config))
    states = explore_and_restore(known, restore, jax.random.key(1), stages=config)
    return [known.coarse, *(state.scene for state in states)]


def _after_paths(paths: float, seed: int) -> dict[str, Figures]:
    """`paths only` is the paper's way, without what is peeled."""
    case = furnished(seed)
    scenes = {OURS: _explored(seed, True), "paths only": _explored(seed, False)}
    found = {name: figures_of(case, splats(states[int(paths)])) for name, states in scenes.items()}
    return found | {name: figures_of(case, METHODS[name](case.given)) for name in ("telea", "mesh")}


REGIMES = (
    Regime("refined white walls", "fog before plain walls", "% of noise of the distance", (0, 2.5, 5, 10, 20), 0, _OFF,
           _white, seeds=1, rows="10"),
    Regime("steps of refinement", "no better, or worse", "steps", (0, 20, 60, 100, 200), 0, _HELD_OUT, _after_steps,
           seeds=2),
    Regime("after an opacity reset", "black, then fog", "steps since", (0, 20, 40, 60, 80, 100), 100, _HELD_OUT,
           _since_reset, seeds=2, rows="11"),
    Regime("full slots", "it stops growing", "% of free slots", (0, 2, 5, 20, 100), 100, _HELD_OUT, _into_slots,
           seeds=1, rows="12"),
    Regime("the same key again", "another scene each time", "runs", (1, 2, 3, 4, 5), 1, _DISTINCT, _again, seeds=1,
           rows="13"),
    Regime("guesses that disagree", "walls of two colours", "levels of 255", (0, 8, 16, 31, 62), 0, _TINT, _tinted,
           seeds=1, rows="25"),
    Regime("number of paths", "holes behind things", "paths", (0, 1, 2, 4, 8, 16), 16, HIDDEN, _after_paths, seeds=2),
)  # fmt: skip
