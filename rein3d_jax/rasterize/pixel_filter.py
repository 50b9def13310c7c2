"""What a pixel does to the splats that it samples: none is narrower than a pixel, and what is smaller is fainter.

A lifted picture's pixels, and its splats' own width, have filtered it already. To add a pixel's variance to every splat
(`added`: gsplat, and Mip-Splatting's eq. 9) filters it once more: seen again from where it was taken, a photo keeps two
thirds of its gradients and shows 3 % of what is behind it. So a splat is widened no more than it needs (`least`): its
covariance C and a pixel's variance v make the root of C^2 + v^2, which is v for a speck and C for what is large.
"""

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.safe import safe_norm
from rein3d_jax.rasterize.config import LEAST, RasterizeConfig

Covariance = tuple[jax.Array, jax.Array, jax.Array, jax.Array]  # xx, xy, yy and the determinant, (n,) each


def filtered(spread: jax.Array, variance: float, *, config: RasterizeConfig) -> tuple[Covariance, jax.Array]:
    """The covariance of footprints `spread` (n, 2, 3), C = spread spread^T, as pixels of `variance` sample them, and
    the logarithm (n,) of the factor for their opacity: with config.antialias that of their areas, so that opacity times
    area stays."""
    xx, xy, yy = (jnp.sum(spread[:, i] * spread[:, j], axis=-1) for i, j in ((0, 0), (0, 1), (1, 1)))
    # xx yy - xy^2 would lose a needle to rounding, and the filter with it: the cross product does not.
    root = safe_norm(jnp.cross(spread[:, 0], spread[:, 1]))
    widened = _least if config.filter == LEAST else _added
    covariance = widened(xx, xy, yy, root * root, variance)
    if not config.antialias:
        return covariance, jnp.zeros_like(root)
    # A splat with no area has no opacity left; the floor keeps its logarithm finite.
    return covariance, jnp.log(jnp.maximum(root, 1e-12) * jax.lax.rsqrt(covariance[3]))


def _added(xx, xy, yy, det, variance) -> Covariance:
    return xx + variance, xy, yy + variance, det + variance * (xx + yy) + variance**2


def _least(xx, xy, yy, det, variance) -> Covariance:
    """(C^2 + v^2)^(1/2), by Cayley and Hamilton: C^2 is tr C - det, and a matrix M's root (M + r) / sqrt(tr M + 2 r)
    with r^2 its determinant."""
    size = xx + yy + variance  # in units of which squares of squares stay in float32's range
    xx, xy, yy, det, v = xx / size, xy / size, yy / size, det / size**2, variance / size
    trace = xx + yy
    squares = jnp.maximum(trace**2 - 2 * det, 0.5 * trace**2)  # of C's eigenvalues, whose sum is the trace
    root = jnp.sqrt(det**2 + v**2 * squares + v**4)
    scale = size * jax.lax.rsqrt(squares + 2 * v**2 + 2 * root)
    rest = v**2 - det + root
    return scale * (trace * xx + rest), scale * trace * xy, scale * (trace * yy + rest), size**2 * root
