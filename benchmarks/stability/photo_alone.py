"""Regimes of a photo that comes without distance: the estimate by the network and the lines, beside a box fitted to the
edges, and a ball of the room's usual size.

Figures over the whole sphere, of distances in metres."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.stability.case import drawn_room, panorama_at
from benchmarks.stability.given_picture import as_jpeg, grainy
from benchmarks.stability.regime import DISTANCE, OURS, SMALL, Figure, Figures, Regime
from rein3d_jax.conventions import EYE_HEIGHT
from rein3d_jax.depth.estimate import estimate_distance
from rein3d_jax.depth.level import estimate_lean, level_panorama
from rein3d_jax.depth.room_shell import RoomShellConfig, fit_room_shell, shell_distance
from rein3d_jax.errors import InputError
from rein3d_jax.evaluate.distance_error import distance_errors
from rein3d_jax.geometry.colour import linear_from_srgb, srgb_from_linear
from rein3d_jax.geometry.rotations import matrix_from_quats
from rein3d_jax.networks.depth import read_depth_network
from rein3d_jax.scene import Panorama

BOX, BALL = "box from edges", "ball"
_ROWS = 128  # the network's
_USUAL = 2.3  # metres: the mean distance in drawn rooms
_LEAN = Figure("lean", "degrees from upright", SMALL, 1.0)

_read = cache(read_depth_network)


@cache
def _photographed(seed: int) -> Panorama:
    return panorama_at(drawn_room(seed), rows=_ROWS)


def _estimated(panorama: Panorama, true: Panorama, height: float = EYE_HEIGHT) -> dict[str, Figures]:
    """Errors against `true` of what is made of the picture."""
    found = {OURS: estimate_distance(panorama.rgb, _read(), height).distance, BALL: jnp.full(true.valid.shape, _USUAL)}
    try:
        shell, _ = fit_room_shell(panorama.rgb, height, config=RoomShellConfig())
        found[BOX] = shell_distance(shell, *true.valid.shape)
    except InputError:  # a picture without edges
        found[BOX] = found[BALL]
    return {name: _errors(distance, true) for name, distance in found.items()}


def _errors(distance: jax.Array, true: Panorama) -> Figures:
    errors = distance_errors(distance, true.distance, true.valid)
    return {"distance": float(errors.abs_rel), "delta": float(errors.delta)}


def _picture(develop: Callable[[Panorama, float, np.random.Generator], Panorama]):
    def measure(severity: float, seed: int) -> dict[str, Figures]:
        true = _photographed(seed)
        return _estimated(develop(true, severity, np.random.default_rng([seed, 11])), true)

    return measure


def _exposed(panorama: Panorama, stops: float, _) -> Panorama:
    """Light times 2^stops, clipped as a sensor does."""
    light = jnp.clip(linear_from_srgb(panorama.rgb) * 2.0**stops, 0, 1)
    return replace(panorama, rgb=srgb_from_linear(jnp.round(light * 4095) / 4095))


def _dark(panorama: Panorama, stops: float, rng: np.random.Generator) -> Panorama:
    """`stops` less light, brought up again: 4000 electrons a pixel at full light, 3 read."""
    light = np.asarray(linear_from_srgb(panorama.rgb)) * 4000 * 2.0**-stops
    counted = rng.poisson(light) + rng.normal(scale=3, size=light.shape)
    return replace(panorama, rgb=srgb_from_linear(jnp.clip(jnp.asarray(counted / (4000 * 2.0**-stops)), 0, 1)))


def _faded(panorama: Panorama, percent: float, _) -> Panorama:
    mean = jnp.mean(panorama.rgb, axis=(0, 1))
    return replace(panorama, rgb=mean + (1 - percent / 100) * (panorama.rgb - mean))


def _thought_at(height: float, seed: int) -> dict[str, Figures]:
    """The camera is thought to stand `height` metres high."""
    true = _photographed(seed)
    return _estimated(true, true, height)


def _levelled(degrees: float, seed: int) -> dict[str, Figures]:
    """Degrees that are left after levelling, beside leaving the picture alone."""
    half, axis = np.radians(degrees) / 2, np.random.default_rng([seed, 2]).uniform(0, 2 * np.pi)
    quats = jnp.array([np.cos(half), np.sin(half) * np.cos(axis), np.sin(half) * np.sin(axis), 0.0])
    rotation = matrix_from_quats(quats)
    leaning = level_panorama(_photographed(seed), rotation)
    up = np.asarray(estimate_lean(leaning.rgb).level_from_picture @ rotation)[:, 2]
    left = float(np.degrees(np.arctan2(np.hypot(up[0], up[1]), up[2])))
    return {OURS: {"lean": left}, "left alone": {"lean": degrees}}


REGIMES = (
    Regime("photo alone: exposure", "rooms of the wrong shape", "stops", (-6, -4, -2, 0, 1, 2, 3), 0, DISTANCE,
           _picture(_exposed)),
    Regime("photo alone: little light", "the same, by night", "stops less light", (0, 2, 4, 6, 8), 0, DISTANCE,
           _picture(_dark)),
    Regime("photo alone: grain", "the same", "deviation, levels of 255", (0, 5, 10, 20, 40), 0, DISTANCE,
           _picture(grainy)),
    Regime("photo alone: JPEG", "the same", "quality", (5, 10, 30, 60, 95), 95, DISTANCE, _picture(as_jpeg)),
    Regime("photo alone: plain walls", "the same, where there is nothing to go by", "% of all contrast gone",
           (0, 50, 75, 90, 97), 0, DISTANCE, _picture(_faded), rows="10"),
    Regime("photo alone: wrong height", "a dolls' house, or a hall", "metres it is said to stand",
           (0.8, 1.2, 1.6, 2.0, 2.4), 1.6, DISTANCE, _thought_at, rows="7"),
    Regime("levelling", "horizons that lean", "degrees", (0, 2, 4, 8, 15), 0, _LEAN, _levelled),
)  # fmt: skip
