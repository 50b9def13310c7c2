"""What a metric is over many rooms, and how sure that is. Each room counts once, whatever number of views it had."""

from typing import NamedTuple

import jax
import jax.numpy as jnp


class OverRooms(NamedTuple):
    """A metric over rooms; a room whose value is NaN (no such pixels there) does not count."""

    mean: jax.Array  # NaN for no rooms
    sem: jax.Array  # standard error of the mean, sample deviation / sqrt(rooms); NaN for fewer than two rooms
    rooms: jax.Array  # int32, how many counted


@jax.jit
def over_rooms(values: jax.Array) -> OverRooms:
    """Statistics (...) of `values` (rooms, ...), one for each room, averaged over its views beforehand.

    An infinite value (the PSNR of equal images) makes the mean infinite and the error NaN.
    """
    counts = ~jnp.isnan(values)
    rooms = jnp.sum(counts, axis=0)
    mean = jnp.sum(jnp.where(counts, values, 0.0), axis=0) / rooms
    squares = jnp.sum(jnp.where(counts, values - mean, 0.0) ** 2, axis=0)
    variance = squares / jnp.where(rooms > 1, rooms - 1, jnp.nan)
    return OverRooms(mean, jnp.sqrt(variance / rooms), rooms)
