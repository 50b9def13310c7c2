"""A splat's log alpha within a tile, as a polynomial of the pixel's offset d from the tile's anchor.

    log_opacity - |axes (anchor + d - mean)|^2 / 2  =  c_0 + sum_j d_j c_j + sum_{j <= k} d_j d_k c_jk

A handful of fused multiply-adds a pixel, and the reverse pass needs only moments of its gradient: sums over pixels
of 1, d_j and d_j d_k. The constant is taken from the whitened offset, since expanding it would lose needles.
"""

import jax
import jax.numpy as jnp


def second_order(k: int) -> list[tuple[int, int]]:
    """The pairs (i, j), i <= j < k: order of the second-order terms."""
    return [(i, j) for i in range(k) for j in range(i, k)]


def terms(k: int) -> int:
    """Number of coefficients: 6 for a pinhole's pixels (u, v), 10 for rays (x, y, z)."""
    return 1 + k + k * (k + 1) // 2


def axes_entries(k: int) -> list[tuple[int, int]]:
    """Entries of `axes` that are stored: a pinhole's are upper triangular."""
    return second_order(2) if k == 2 else [(i, j) for i in range(k) for j in range(k)]


def coefficients(offset: list, axes: dict, log_opacity: jax.Array) -> list[jax.Array]:
    """Offset anchor - mean (k arrays), axes {(i, j): array}, log opacity, all of one shape -> `terms(k)` arrays."""
    k = len(offset)
    white = [sum(axes[i, j] * offset[j] for j in range(k) if (i, j) in axes) for i in range(k)]
    constant = log_opacity - 0.5 * sum(w * w for w in white)
    first = [-sum(axes[i, j] * white[i] for i in range(k) if (i, j) in axes) for j in range(k)]
    second = [
        (-0.5 if j == m else -1.0) * sum(axes[i, j] * axes[i, m] for i in range(k) if {(i, j), (i, m)} <= axes.keys())
        for j, m in second_order(k)
    ]
    return [constant, *first, *second]


def evaluate_quadratic(row: list, pixels: list) -> jax.Array:
    """Coefficients `row` (terms(k) arrays) at the offsets `pixels` (k arrays): log alpha, in Horner's order."""
    k = len(pixels)
    inner = list(row[1 : 1 + k])
    for (i, j), c in zip(second_order(k), row[1 + k :], strict=True):
        inner[i] = inner[i] + c * pixels[j]
    total = row[0]
    for x, slope in zip(pixels, inner, strict=True):
        total = total + x * slope
    return total


def monomials(pixels: list) -> list[jax.Array]:
    """What the coefficients multiply: 1, d_j, d_j d_k."""
    pairs = [pixels[i] * pixels[j] for i, j in second_order(len(pixels))]
    return [jnp.ones_like(pixels[0]), *pixels, *pairs]
