"""A distance for the pixels that have none, so that what the photograph shows there has a place.

What is unknown lies on the surface around it, and where much is, on the room's shell, or is a window or an open door.
What shows through these is far away, and a copy of it pasted onto the wall would move wrongly with every step of the
camera; what a sensor lost, or a black thing swallowed, is not. A window is told by the picture: its outline is an edge
there, it is not black, and it is not in the floor. The mask of what is known is the caller's and stays what it was: an
estimate is not an observation.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp

from rein3d_jax.depth.shell_from_distance import shell_from_distance
from rein3d_jax.geometry.morphology import closing, window_sum
from rein3d_jax.geometry.push_pull import push_pull
from rein3d_jax.geometry.shell import FACES, meet_shell
from rein3d_jax.geometry.sphere import pixel_rays, pixel_solid_angles
from rein3d_jax.scene import Panorama
from rein3d_jax.settings import Settings, setting

_SHELL = 0.1  # share of the sphere that lies on the shell, at least, or it says nothing
_SIDE = 2  # pixels on each side of an outline that are compared
_CONTRAST = 0.06  # in sRGB, beside the sides' own deviations
_BLACK = 0.1  # in sRGB: no window by day; one by night may as well be a pane
# Share of an outline that is an edge of the picture. Windows of eight rooms: 0.79 to 1 at 256 rows, 0.55 to 1 at 64;
# blocks taken out anywhere: at most 0.10 and 0.18.
_OUTLINED = 0.4
_REACH = 4  # over the rows: the weight of an outline's pixel, so that the share is of about an eighth of a half circle


@dataclass(frozen=True)
class CompleteConfig(Settings):
    """The completion's settings: where the pixels of unknown distance are placed."""

    speck: int = setting(4, "radius of holes that belong to the surface around them", within="[0, inf)", unit="pixels")
    far: float = setting(10.0, "distance of windows, over the median known distance", within="[1, inf)")


def _complete_distance(panorama: Panorama, *, config: CompleteConfig) -> jax.Array:
    """The distance (h, w) metres of every pixel, equal to the panorama's where that is valid, finite everywhere
    whatever stands in the unknown pixels. Where nothing at all is known: 0. Inverse distance over the shell's is what
    is averaged: a plane's is linear in the ray, so a smooth fill bends a wall little, and far things do not outvote
    near ones."""
    distance, valid = panorama.distance, panorama.valid
    assert distance.shape == valid.shape == panorama.rgb.shape[:2], (distance.shape, valid.shape)
    wall, floor = _shell_of(panorama)
    inverse = jnp.where(valid, wall / jnp.where(valid, distance, 1.0), 0.0)[..., None]
    smooth = push_pull(inverse, valid.astype(distance.dtype))[..., 0]
    near = jnp.where(smooth > 0, wall / jnp.where(smooth > 0, smooth, 1.0), 0.0)
    median = jnp.nanmedian(jnp.where(valid, distance, jnp.nan))
    far = jnp.where(jnp.isnan(median), 0.0, config.far * median)
    window = ~closing(valid, config.speck)
    if panorama.doubt is None:  # of an estimate, what is unknown is what it takes for the outside
        window &= (_outlined(panorama) > _OUTLINED) & ~floor
    return jnp.where(valid, distance, jnp.where(window, jnp.maximum(far, near), near))


complete_distance = jax.jit(_complete_distance, static_argnames=("config",))


def _shell_of(panorama: Panorama) -> tuple[jax.Array, jax.Array]:
    """The shell's distance (h, w) and where it is the floor; 1 and nowhere, where what is known is no box."""
    shell, support = shell_from_distance(panorama)
    area = jnp.broadcast_to(pixel_solid_angles(*panorama.valid.shape), panorama.valid.shape)
    told = support * jnp.sum(area * panorama.valid) > _SHELL * jnp.sum(area)
    wall, face = meet_shell(shell, jnp.zeros(3), pixel_rays(*panorama.valid.shape))
    return jnp.where(told, wall, 1.0), told & (face == FACES - 1)


def _outlined(panorama: Panorama) -> jax.Array:
    """Share (h, w), in [0, 1], of the outline of what is unknown that is an edge of the picture, around each pixel:
    there the colours of both sides differ by more than they vary within each."""
    rgb, known = panorama.rgb, panorama.valid.astype(jnp.float32)
    inside, outside = _colours(rgb, 1 - known), _colours(rgb, known)
    both = jnp.minimum(inside[0], outside[0]) > 2 * _SIDE  # a row of pixels on either side, at least
    across = jnp.sum((inside[1] - outside[1]) ** 2, axis=-1) > inside[2] + outside[2] + _CONTRAST**2
    edge = across & (jnp.mean(inside[1], axis=-1) > _BLACK)
    weight = both * (1 - known) * min(_REACH / len(rgb), 1.0)
    return push_pull(edge[..., None].astype(jnp.float32), weight)[..., 0]


def _colours(rgb: jax.Array, share: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
    """How many pixels (h, w) of a mask are near, their mean colour (h, w, 3), and their variance (h, w)."""
    count = window_sum(share, _SIDE)
    total = window_sum(jnp.concatenate([rgb, rgb**2], axis=-1) * share[..., None], _SIDE)
    mean, square = jnp.split(total / jnp.maximum(count, 1.0)[..., None], 2, axis=-1)
    return count, mean, jnp.sum(jnp.maximum(square - mean**2, 0.0), axis=-1)
