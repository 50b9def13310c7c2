"""The longest straight path through a place (paper, Sec. 3: "longest traversable diagonal"), or from it outwards."""

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.explore.profile import ExploreConfig, band_profile, safe_distances, travel
from rein3d_jax.geometry.sphere import azimuths, horizontal_direction


@struct.dataclass
class Chord:
    """A level straight path; every point of it keeps the clearance of profile.py from what the panorama saw."""

    start: jax.Array  # (3,) metres, world
    direction: jax.Array  # (3,) unit
    length: jax.Array  # () metres


def _longest_chord(
    distance: jax.Array, valid: jax.Array, *, config: ExploreConfig = ExploreConfig(), through: bool = True
) -> Chord:
    """The longest path by the panorama's distance (h, w), metres, along one of its w column directions.

    It runs through the panorama's centre from one end to the other, or with `through` False starts at the centre.
    Behind the centre it is as safe as before it: both halves are radial paths of Algorithm 1.
    """
    width = distance.shape[1]
    assert width % 2 == 0, "the direction opposite to a column's must be a column's"
    directions = azimuths(width)
    raw = band_profile(distance, valid, config=config)
    ahead = travel(safe_distances(raw, directions, config=config), config=config)
    behind = jnp.roll(ahead, width // 2) if through else jnp.zeros_like(ahead)
    best = jnp.argmax(ahead + behind)
    direction = horizontal_direction(directions[best])
    return Chord(-behind[best] * direction, direction, ahead[best] + behind[best])


longest_chord = jax.jit(_longest_chord, static_argnames=("config", "through"))
