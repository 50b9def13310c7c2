"""How far a camera may go from the panorama's centre, by direction: the safe radial profile (paper, Algorithm 1).

A direction is an azimuth in radians that turns right, as in conventions.py: azimuth a is (cos a, -sin a, 0).

The law that all of explore/ stands on: a straight path of length travel(...) along its direction comes no nearer to
any band point than `camera_radius + stop_buffer`, or than the origin itself is, where the origin is nearer.
"""

import math
from dataclasses import dataclass

import jax
import jax.numpy as jnp

from rein3d_jax.errors import InputError
from rein3d_jax.geometry.sphere import azimuths
from rein3d_jax.settings import Settings, setting


@dataclass(frozen=True)
class ExploreConfig(Settings):
    """Exploration's settings: where a camera may go, and how far."""

    trajectories: int = setting(8, "paths from the centre outwards, tau", within="[1, inf)")
    camera_radius: float = setting(0.2, "room that the camera itself takes, r_c", within="[0, inf)", unit="metres")
    stop_buffer: float = setting(0.2, "room left before a surface, b_s", within="[0, inf)", unit="metres")
    step: float = setting(0.25, "way between frames", within="(0, inf)", unit="metres")
    max_frames: int = setting(41, "frames that a path holds; those that do not fit are counted", within="[1, inf)")
    band: tuple[float, float] = setting((0.45, 0.55), "rows of obstacles, as shares of the height", within="[0, 1]")
    viewpoints: int = setting(4, "evaluation viewpoints besides the centre, N_fps", within="[0, inf)")
    viewpoint_samples: int = setting(2000, "Monte Carlo candidates for them, M", within="[1, inf)")
    min_viewpoint_travel: float = setting(0.1, "way to a viewpoint at least", within="[0, inf)", unit="metres")
    max_length: float = setting(math.inf, "length of a path at most", within="[0, inf]", unit="metres")
    min_revealed: float = setting(0.0, "share of the sphere that a path's end reveals at least", within="[0, 1)")

    def __post_init__(self):
        super().__post_init__()
        if self.band[0] >= self.band[1]:
            raise InputError(f"band {self.band} must be two shares of the height, the smaller first")

    @property
    def clearance(self) -> float:
        """The clearance R = r_c + b_s, metres."""
        return self.camera_radius + self.stop_buffer


def _last_known(profile: jax.Array, known: jax.Array) -> jax.Array:
    """The value of the nearest known column at or before each one, wrapped; any value where none is known."""
    width = profile.shape[0]
    columns = jnp.where(jnp.tile(known, 2), jnp.arange(2 * width), -1)
    return profile[jax.lax.cummax(columns)[width:] % width]


def band_profile(distance: jax.Array, valid: jax.Array, *, config: ExploreConfig) -> jax.Array:
    """The raw profile D_raw (w,): smallest known distance over each column's band rows (Algorithm 1, lines 1 and 2).

    A column with nothing known takes the smaller of its nearest known neighbours, wrapped; with nothing known at all
    the profile is 0, and no path leaves the origin.
    """
    height = distance.shape[0]
    rows = slice(math.floor(config.band[0] * height), max(math.ceil(config.band[1] * height), 1))
    nearest = jnp.min(jnp.where(valid[rows], distance[rows], jnp.inf), axis=0)
    known = jnp.any(valid[rows], axis=0)
    following = _last_known(nearest[::-1], known[::-1])[::-1]
    filled = jnp.minimum(_last_known(nearest, known), following)
    return jnp.where(jnp.any(known), filled, 0.0)


def safe_distances(profile: jax.Array, directions: jax.Array, *, config: ExploreConfig) -> jax.Array:
    """The safe distance D_safe (n,) in directions (n,): a wrapped minimum filter of D_raw (w,) (Algorithm 1, line 3).

    An obstacle at distance D and angle delta from the direction matters when delta <= asin(min(1, R / D)).
    If it does not, the line passes it at D sin(delta) > R, and beyond 90 degrees the path only leaves it.
    If it does, the path is at most D - R long, and by the triangle inequality ends no nearer to it than R.
    If D < R, every direction within 90 degrees of it is closed, the others lead away: nothing gets nearer than it was.
    Obstacles off the horizon are farther from a level path than level ones of the same D and azimuth, and
    farther ones of the column have a narrower asin and allow a longer path, so D_raw speaks for all of them.
    Half a column is added for the surface between column centres.
    """
    width = profile.shape[0]
    angle = directions[:, None] - azimuths(width)
    delta = jnp.abs(jnp.mod(angle + jnp.pi, 2 * jnp.pi) - jnp.pi)
    ratio = config.clearance / jnp.maximum(profile, jnp.finfo(profile.dtype).tiny)
    # 1 % more than half a column, so that rounding never leaves a direction between two columns with neither.
    half_width = jnp.arcsin(jnp.minimum(1.0, ratio)) + 1.01 * jnp.pi / width
    return jnp.min(jnp.where(delta <= half_width, profile, jnp.inf), axis=1)


def travel(safe: jax.Array, *, config: ExploreConfig) -> jax.Array:
    """The way l = max(0, D_safe - r_c - b_s) in metres (Algorithm 1, line 15; D_usable of Algorithm 2, line 1)."""
    return jnp.maximum(0.0, safe - config.clearance)
