"""Walks through a run's safe area: places one after another, level with the input panorama's centre."""

from pathlib import Path

import numpy as np

from experiments.run_folder import RunFolder
from rein3d_jax.conventions import EYE_HEIGHT
from rein3d_jax.depth.scale import height_above_floor
from rein3d_jax.errors import InputError
from rein3d_jax.explore.profile import travel
from rein3d_jax.geometry.sphere import azimuths, horizontal_direction
from rein3d_jax.io.files.json_file import read_json

STEP = 0.1  # metres between the frames of a random walk: someone's slow walk at 10 frames a second
_AHEAD = 0.4  # metres of way that a camera looks ahead along it: so it turns before a corner
_TRIES = 64  # of a next place to walk to, before the way leads over the origin
_CHECK = 0.02  # metres between the places of a straight way that are checked


class SafeArea:
    """Where a camera may stand: for each azimuth so far from the origin (explore/profile.py)."""

    def __init__(self, run: RunFolder):
        self.reach = np.asarray(travel(run.trajectories.safe, config=run.config.explore), np.float64)  # (w,) metres
        self._rays = np.asarray(horizontal_direction(azimuths(len(self.reach))), np.float64)[:, :2]

    def holds(self, places: np.ndarray) -> np.ndarray:
        """Whether places (..., 2) lie inside: between two columns both must reach so far."""
        column = (np.arctan2(-places[..., 1], places[..., 0]) / (2 * np.pi) + 0.5) * len(self.reach) - 0.5
        low = np.floor(column).astype(int)
        nearest = np.minimum(self.reach[low % len(self.reach)], self.reach[(low + 1) % len(self.reach)])
        return np.linalg.norm(places, axis=-1) <= nearest

    def outline(self) -> np.ndarray:
        """Its corners (w, 2), turning left."""
        return (self.reach[:, None] * self._rays)[::-1]

    def draw(self, random: np.random.Generator) -> np.ndarray:
        """A place (2,) of it, uniform in area."""
        share = self.reach**2 / np.sum(self.reach**2)
        column = random.choice(len(self.reach), p=share)
        return self.reach[column] * np.sqrt(random.uniform()) * self._rays[column]


def random_walk(area: SafeArea, frames: int, seed: int) -> np.ndarray:
    """Places (frames, 2), STEP apart, along straight ways inside `area` from one random place to the next, beginning at
    the origin. Raises InputError where there is no room to walk."""
    if area.reach.max() < STEP:
        raise InputError("the panorama's centre has no room around it to walk in: give --walk FILE")
    random, corners, length = np.random.default_rng(seed), [np.zeros(2)], 0.0
    while length < STEP * frames:
        corners += _next(area, corners[-1], random)
        length = _lengths(np.array(corners))[-1]
    return _along(np.array(corners), STEP * np.arange(frames))


def read_walk(path: Path, frames: int) -> np.ndarray:
    """Places (frames, 2), evenly along the corners in a JSON file: a list of two [x, y] or more, metres in the world.
    Raises InputError if it is none."""
    try:
        corners = np.array(read_json(path), np.float64)
    except (TypeError, ValueError):
        corners = np.zeros(0)
    if corners.ndim != 2 or len(corners) < 2 or corners.shape[1] != 2 or not np.isfinite(corners).all():
        raise InputError(f"{path} is no walk: give a JSON list of places, such as [[0, 0], [1.5, -0.4]], in metres")
    length = _lengths(corners)[-1]
    if length == 0:
        raise InputError(f"{path} names one place only: a walk has a length")
    return _along(corners, np.linspace(0, length, frames))


def headings(places: np.ndarray) -> np.ndarray:
    """Yaws (n,), radians to the left, along a walk of places (n, 2): towards where it is _AHEAD metres later; at its
    end as before."""
    way = _lengths(places)
    later = np.searchsorted(way, way + _AHEAD)
    inside = later < len(places)
    ahead = places[np.minimum(later, len(places) - 1)] - places
    moves = inside & (np.linalg.norm(ahead, axis=1) > 1e-6)
    if not moves.any():  # shorter than _AHEAD
        ahead, moves = np.broadcast_to(places[-1] - places[0], places.shape), np.ones(len(places), bool)
    yaws = np.arctan2(ahead[:, 1], ahead[:, 0])
    last = np.maximum.accumulate(np.where(moves, np.arange(len(places)), np.argmax(moves)))
    return yaws[last]


def floor_depth(run: RunFolder) -> float:
    """Metres from the panorama's centre down to the floor; someone's eye height where no floor shows."""
    try:
        return height_above_floor(run.panorama)
    except InputError:
        return EYE_HEIGHT


def _next(area: SafeArea, here: np.ndarray, random: np.random.Generator) -> list[np.ndarray]:
    """The next corners: a place straight ahead, or over the origin, which has all of the area in a straight line."""
    for _ in range(_TRIES):
        place = area.draw(random)
        way = np.linalg.norm(place - here)
        steps = np.linspace(0, 1, 2 + int(way / _CHECK))[:, None]
        if way > STEP and area.holds(here + steps * (place - here)).all():
            return [place]
    return [np.zeros(2), area.draw(random)]


def _lengths(corners: np.ndarray) -> np.ndarray:
    return np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])


def _along(corners: np.ndarray, ways: np.ndarray) -> np.ndarray:
    known = _lengths(corners)
    return np.stack([np.interp(ways, known, corners[:, axis]) for axis in range(2)], axis=1)
