"""3-vectors as tuples of arrays (x, y, z): pixels stay innermost, and XLA fuses whole formulas into one loop."""

import jax
import jax.numpy as jnp

Vector = tuple[jax.Array, jax.Array, jax.Array]


def components(array: jax.Array) -> Vector:
    """Components x, y, z (...) of an array (..., 3)."""
    return array[..., 0], array[..., 1], array[..., 2]


def add(a: Vector, b: Vector) -> Vector:
    """Sum a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def subtract(a: Vector, b: Vector) -> Vector:
    """Difference a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def scale(a: Vector, factor: jax.Array) -> Vector:
    """Product of a and a scalar field."""
    return a[0] * factor, a[1] * factor, a[2] * factor


def dot(a: Vector, b: Vector) -> jax.Array:
    """Inner product a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def unit(a: Vector) -> Vector:
    """Unit vector a / |a|."""
    return scale(a, jax.lax.rsqrt(dot(a, a)))


def rotate_right(a: Vector, heading: tuple[jax.Array, jax.Array]) -> Vector:
    """`a` rotated RIGHT about +Z by a `heading` (cosine, sine): into the axes of a thing that has this yaw."""
    return heading[0] * a[0] + heading[1] * a[1], heading[0] * a[1] - heading[1] * a[0], a[2]


def rotate_left(a: Vector, heading: tuple[jax.Array, jax.Array]) -> Vector:
    """Inverse of rotate_right."""
    return heading[0] * a[0] - heading[1] * a[1], heading[1] * a[0] + heading[0] * a[1], a[2]


def choose(condition: jax.Array, a: Vector, b: Vector) -> Vector:
    """Vector a where the condition holds, else b."""
    return tuple(jnp.where(condition, x, y) for x, y in zip(a, b, strict=True))
