"""A room's distance put together from what three witnesses say of it: the depth network's background, its detail, and
the shell that the picture's own lines bear out.

Where the shell agrees with the background in shape, walls and ceiling are the shell's planes, and the background's
size is the shell's everywhere. Things stand before it or are seen beyond it, through a door, and end where the picture
shows that they do: a pixel belongs to the room or to a thing, never to a place between them."""

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.depth.guided import guided_by
from rein3d_jax.geometry.morphology import window_sum
from rein3d_jax.geometry.push_pull import push_pull
from rein3d_jax.geometry.sphere import pixel_rays, pixel_solid_angles

_FLOOR = 0.97  # camera heights below the camera from which on a background is floor
_AGREES = 0.12  # log of distance by which a shell may be off the background
_BELIEVED = 0.8  # share of walls and ceiling that has to agree, or the shell is no witness
_OFF_FLOOR, _OFF_WALLS = 0.05, 0.1  # log of distance by which what is no floor, no wall and no ceiling is off it
_BEYOND = 0.3  # the same of what is farther than walls and ceiling
_HIDDEN = 0.12  # log of distance by which a thing has to stand before a line of the room to hide it
_SOFT = 0.2  # of those, over which one becomes the other
_RIM = 2 / 128  # of a picture's rows, over which the network blurs the rim of a thing


@struct.dataclass
class FurnishedRoom:
    """A room and what stands in it, over the camera's height."""

    distance: jax.Array  # (h, 2 h)
    things: jax.Array  # (h, 2 h) bool: what is seen is not the empty room


def furnished_room(rgb: jax.Array, distance: jax.Array, background: jax.Array, shell: jax.Array) -> FurnishedRoom:
    """The FurnishedRoom of a picture (h, 2 h, 3) in sRGB from the network's distance and background and a shell's
    distance, all (h, 2 h) over the camera's height."""
    empty, size, _ = agreed_background(background, shell)
    thing = things(distance, background)
    whose = guided_by(rgb, thing) > 0.5
    # A thing's rim takes the distance of its inside, in inverse distance, whose planes are linear; what is all rim
    # keeps its own.
    rim = max(round(_RIM * len(rgb)), 1)
    inside = jnp.where(window_sum((thing < 0.5).astype(thing.dtype), rim) == 0, 1.0, 1e-3 * thing)
    placed = distance * jnp.where(distance > background, size, 1.0)  # what is beyond is as much larger as the room
    inverse = push_pull((1 / placed)[..., None], inside)[..., 0]
    return FurnishedRoom(jnp.where(whose, 1 / inverse, empty), whose)


def things(distance: jax.Array, background: jax.Array) -> jax.Array:
    """How far (h, w), in [0, 1], what is seen is not the room's background."""
    nearer = jnp.log(background / distance)
    off = jnp.where(is_floor(background), _OFF_FLOOR, jnp.where(nearer > 0, _OFF_WALLS, _BEYOND))
    return jax.nn.sigmoid((jnp.abs(nearer) - off) / (_SOFT * off))


def room_seen(distance: jax.Array, background: jax.Array) -> jax.Array:
    """How far (h, w), in [0, 1], nothing hides the room's background: not as strict as `things`, since a room's lines
    count where it is not sure that they are hidden."""
    return jax.nn.sigmoid((_HIDDEN - jnp.log(background / distance)) / (_SOFT * _HIDDEN))


def is_floor(background: jax.Array) -> jax.Array:
    """Where (h, w) an empty room's distance is its floor's."""
    return background * -pixel_rays(*background.shape)[..., 2] > _FLOOR


def agreed_background(background: jax.Array, shell: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
    """The empty room's distance (h, w) that a network's background and a shell agree on, by how much () the shell is
    larger, and their agreement ()."""
    floor = is_floor(background)
    area = pixel_solid_angles(*background.shape) * ~floor
    off = jnp.log(shell / background)
    size = _weighted_median(off, area)
    # Both have the same floor; where it ends depends on the size, too.
    apart = jnp.where(floor, jnp.minimum(jnp.abs(off), jnp.abs(off - size)), jnp.abs(off - size))
    support = jnp.sum(area * (apart < _AGREES)) / jnp.sum(area)
    agrees = jnp.exp(-((apart / _AGREES) ** 2))
    sized = jnp.log(background) + jnp.where(floor, 0.0, size)
    both = agrees * jnp.log(shell) + (1 - agrees) * sized
    believed = support > _BELIEVED
    return jnp.exp(jnp.where(believed, both, jnp.log(background))), jnp.where(believed, jnp.exp(size), 1.0), support


def _weighted_median(values: jax.Array, weights: jax.Array) -> jax.Array:
    order = jnp.argsort(values.ravel())
    cumulative = jnp.cumsum(weights.ravel()[order])
    return values.ravel()[order][jnp.searchsorted(cumulative, cumulative[-1] / 2)]
