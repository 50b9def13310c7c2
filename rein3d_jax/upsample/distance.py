"""A distance map brought to a picture's size: on each surface its plane, at depth edges one surface or the other.

Inverse distance is linear over a plane, so its mean over a block, and its interpolation, are exact there.
"""

from functools import partial

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.morphology import window_range
from rein3d_jax.geometry.resample import pad_sphere, sample_sphere

SAME_SURFACE = 1.2  # ratio within 3 x 3 pixels; a wall of 256 rows seen at 75 degrees has 1.1
_NEAR = 0.6  # pixels of the map: standard deviation of how far its pixels speak for a place
_ALIKE = 0.06  # sRGB: the same of how far colours tell surfaces apart
_WHERE_NOT = 1e-4  # what place says where no colour is alike


def distance_for(picture: jax.Array, distance: jax.Array) -> jax.Array:
    """Distance (h, 2 h) in metres, 0 where unknown, for a picture (h, 2 h, 3) in sRGB, of a map (k, 2 k) of another
    size."""
    rows = len(picture)
    if len(distance) == rows:
        return distance
    return finer_distance(distance, picture) if len(distance) < rows else coarser_distance(distance, rows=rows)


@partial(jax.jit, static_argnames="rows")
def coarser_distance(distance: jax.Array, *, rows: int) -> jax.Array:
    """Distance (rows, 2 rows) of a larger map (k, 2 k) in metres, 0 where unknown: of each pixel's block the mean of
    the surface that has most of it; the nearest value where k is no multiple of `rows`."""
    size, rest = divmod(len(distance), rows)
    if rest:
        rows_of, columns_of = _holders(len(distance), rows), _holders(2 * len(distance), 2 * rows)
        return distance[rows_of][:, columns_of]
    block = distance.reshape(rows, size, 2 * rows, size).transpose(0, 2, 1, 3).reshape(rows, 2 * rows, size * size)
    known = block > 0
    least, most = jnp.where(known, block, jnp.inf).min(-1), block.max(-1)
    near = known & (block <= jnp.sqrt(least * most)[..., None])
    whole, mostly_near = most < SAME_SURFACE * least, 2 * near.sum(-1) >= known.sum(-1)
    chosen = known & (whole[..., None] | (near == mostly_near[..., None]))
    inverse = jnp.where(chosen, 1 / jnp.where(chosen, block, 1.0), 0.0).sum(-1)
    return jnp.where(2 * known.sum(-1) >= size * size, chosen.sum(-1) / jnp.where(inverse > 0, inverse, 1.0), 0.0)


@jax.jit
def finer_distance(distance: jax.Array, picture: jax.Array) -> jax.Array:
    """Distance (h, 2 h) of a smaller map (k, 2 k) in metres, 0 where unknown, for a picture (h, 2 h, 3) in sRGB.

    Beside a depth edge a pixel goes to the surface whose colours are like its own (joint bilateral upsampling, Kopf et
    al. 2007, as a choice: nothing lies between two surfaces), and takes the plane of that surface's nearest pixel."""
    (height, width), small = picture.shape[:2], len(distance)
    known = distance > 0
    inverse = jnp.where(known, 1 / jnp.where(known, distance, 1.0), 0.0)
    colours = jax.image.resize(picture, (small, 2 * small, 3), "linear")
    around = pad_sphere(jnp.concatenate([inverse[..., None], _slopes(inverse), colours], axis=-1), 1)
    lowest, most = window_range(inverse)  # 0 where one is unknown
    least, _ = window_range(jnp.where(known, inverse, jnp.inf))
    row, column = _holders(small, height)[:, None], _holders(2 * small, width)[None]
    one_surface, least, most = (x[row, column] for x in (most < SAME_SURFACE * lowest, least, most))
    v, u = ((jnp.arange(n) + 0.5) * small / height for n in (height, width))

    def speaks(offset):
        """Inverse distance that a neighbour of the pixel that holds a place has there, its own, and its weights."""
        at = around[row + 1 + offset[0], column + 1 + offset[1]]
        down, right = v[:, None] - (row + offset[0] + 0.5), u[None] - (column + offset[1] + 0.5)
        place = jnp.exp(-(down**2 + right**2) / (2 * _NEAR**2)) * (at[..., 0] > 0)
        alike = jnp.exp(-jnp.sum((at[..., 3:] - picture) ** 2, axis=-1) / (2 * _ALIKE**2))
        return at[..., 0] + right * at[..., 1] + down * at[..., 2], at[..., 0], place, place * (alike + _WHERE_NOT)

    neighbours = jnp.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)])
    blank = jnp.zeros((height, width))

    between = jnp.sqrt(least * most)

    def vote(carry, offset):
        value, own, place, weight = speaks(offset)
        sides = []
        for (total, best, found), there in zip(carry, (own > between, own <= between), strict=True):
            nearer = there & (place > best)
            sides.append((total + there * weight, jnp.where(nearer, place, best), jnp.where(nearer, value, found)))
        return tuple(sides), None

    (near, far), _ = jax.lax.scan(vote, ((blank,) * 3, (blank,) * 3), neighbours)
    chosen = jnp.clip(jnp.where(near[0] > far[0], near[2], far[2]), least / 1.05, 1.05 * most)
    smooth = sample_sphere(inverse, *jnp.broadcast_arrays(u[None], v[:, None]))
    found = jnp.where(one_surface, smooth, chosen)
    return jnp.where(known[row, column], 1 / jnp.where(found > 0, found, 1.0), 0.0)


def _holders(size: int, new_size: int) -> jax.Array:
    """(new_size,) index of the pixel, of `size`, that holds each new pixel's centre."""
    return (2 * jnp.arange(new_size) + 1) * size // (2 * new_size)


def _slopes(inverse: jax.Array) -> jax.Array:
    """Steps (k, 2 k, 2) from pixel to pixel, rightward and downward: the smaller of both sides', 0 at an edge."""
    padded = pad_sphere(inverse, 1)
    sides = [
        (inverse - padded[1:-1, :-2], padded[1:-1, 2:] - inverse),
        (inverse - padded[:-2, 1:-1], padded[2:, 1:-1] - inverse),
    ]
    least = [jnp.where(a * b > 0, jnp.sign(a) * jnp.minimum(jnp.abs(a), jnp.abs(b)), 0.0) for a, b in sides]
    return jnp.stack(least, axis=-1)
