"""Rotations: quaternions (wxyz) and matrices that act on column vectors."""

import jax
import jax.numpy as jnp
import numpy as np

from rein3d_jax.geometry.array_namespace import array_namespace
from rein3d_jax.geometry.safe import safe_norm


def normalize_quats(quats: jax.Array | np.ndarray) -> jax.Array | np.ndarray:
    """Unit quaternions (..., 4); the zero quaternion, which names no rotation, becomes the identity."""
    assert quats.shape[-1] == 4, quats.shape
    xp, norm = array_namespace(quats), safe_norm(quats, keepdims=True)
    identity = xp.array([1.0, 0.0, 0.0, 0.0], quats.dtype)
    return xp.where(norm > 0, quats / xp.where(norm > 0, norm, 1.0), identity)


def matrix_from_quats(quats: jax.Array) -> jax.Array:
    """Rotation matrices (..., 3, 3) of quaternions (..., 4) wxyz of any length."""
    w, x, y, z = jnp.moveaxis(normalize_quats(quats), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return jnp.stack([jnp.stack(row, axis=-1) for row in rows], axis=-2)


def quats_from_matrix(matrix: jax.Array | np.ndarray) -> jax.Array | np.ndarray:
    """Unit quaternions (..., 4) wxyz, of either sign, of rotations (..., 3, 3), in their precision. Of the four ways to
    write it, the one that divides by the largest component (Shepperd 1978)."""
    xp = array_namespace(matrix)
    m = [[matrix[..., i, j] for j in range(3)] for i in range(3)]
    trace = m[0][0] + m[1][1] + m[2][2]
    products = [  # row k: 4 q_k (w, x, y, z)
        [1 + trace, m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]],
        [m[2][1] - m[1][2], 1 + 2 * m[0][0] - trace, m[0][1] + m[1][0], m[0][2] + m[2][0]],
        [m[0][2] - m[2][0], m[0][1] + m[1][0], 1 + 2 * m[1][1] - trace, m[1][2] + m[2][1]],
        [m[1][0] - m[0][1], m[0][2] + m[2][0], m[1][2] + m[2][1], 1 + 2 * m[2][2] - trace],
    ]
    rows = xp.stack([xp.stack(row, axis=-1) for row in products], axis=-2)
    largest = xp.argmax(xp.diagonal(rows, axis1=-2, axis2=-1), axis=-1)
    return normalize_quats(xp.take_along_axis(rows, largest[..., None, None], axis=-2)[..., 0, :])


def yaw_quat(angle: jax.Array) -> jax.Array:
    """The rotation to the LEFT by `angle` radians about +Z (right-handed): () -> (4,) wxyz."""
    angle = jnp.asarray(angle, jnp.float32)
    zero = jnp.zeros_like(angle)
    return jnp.stack([jnp.cos(angle / 2), zero, zero, jnp.sin(angle / 2)], axis=-1)
