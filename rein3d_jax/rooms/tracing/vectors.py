"""3-vectors as tuples of arrays (x, y, z): pixels stay innermost, and XLA fuses whole formulas into one loop."""

import jax
import jax.numpy as jnp

Vector = tuple[jax.Array, jax.Array, jax.Array]


def split(array: jax.Array) -> Vector:
    """(..., 3) -> three (...)."""
    return array[..., 0], array[..., 1], array[..., 2]


def add(a: Vector, b: Vector) -> Vector:
    """a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def subtract(a: Vector, b: Vector) -> Vector:
    """a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def scale(a: Vector, factor: jax.Array) -> Vector:
    """a times a scalar field."""
    return a[0] * factor, a[1] * factor, a[2] * factor


def dot(a: Vector, b: Vector) -> jax.Array:
    """Inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def unit(a: Vector) -> Vector:
    """a / |a|."""
    return scale(a, jax.lax.rsqrt(dot(a, a)))


def turn_right(a: Vector, turn: Vector) -> Vector:
    """Turns a about +Z by minus the angle of `turn` (cosine, sine): into the axes of a thing turned left by it."""
    return turn[0] * a[0] + turn[1] * a[1], turn[0] * a[1] - turn[1] * a[0], a[2]


def turn_left(a: Vector, turn: Vector) -> Vector:
    """The inverse of turn_right."""
    return turn[0] * a[0] - turn[1] * a[1], turn[1] * a[0] + turn[0] * a[1], a[2]


def choose(condition: jax.Array, a: Vector, b: Vector) -> Vector:
    """a where the condition holds, else b."""
    return tuple(jnp.where(condition, x, y) for x, y in zip(a, b, strict=True))
