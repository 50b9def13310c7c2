"""How near an image comes to its reference. Images are (..., h, w, c) in [0, 1]; one value for each leading index."""

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.resample import pad_sphere
from rein3d_jax.geometry.sphere import latitudes
from rein3d_jax.geometry.structural_similarity import WINDOW, ssim_map


@jax.jit
def psnr(image: jax.Array, reference: jax.Array, *, weights: jax.Array | None = None) -> jax.Array:
    """Peak signal-to-noise ratio in dB, infinite for equal images: -10 log10 of the mean squared error.

    `weights` broadcasts with (..., h, w): a mask of the pixels that count, or each pixel's share; NaN where all are 0.
    """
    assert image.shape == reference.shape, (image.shape, reference.shape)
    squared = jnp.mean((image - reference) ** 2, axis=-1)
    return -10 * jnp.log10(jnp.average(squared, axis=(-2, -1), weights=_full(weights, squared.shape)))


@jax.jit
def ws_psnr(image: jax.Array, reference: jax.Array) -> jax.Array:
    """PSNR of equirectangular images, pixels weighted by cos(latitude) (Sun et al. 2017, WS-PSNR)."""
    return psnr(image, reference, weights=_row_weights(image.shape[-3]))


@jax.jit
def ssim(image: jax.Array, reference: jax.Array) -> jax.Array:
    """Mean structural similarity, 1 for equal images (Wang et al. 2004, eq. 17), over pixels and channels."""
    return jnp.mean(ssim_map(image, reference), axis=(-3, -2, -1))


@jax.jit
def ws_ssim(image: jax.Array, reference: jax.Array) -> jax.Array:
    """SSIM of equirectangular images, pixels weighted by cos(latitude) (Zhou et al. 2018, WS-SSIM). The window runs on
    across +-180 degrees and over the poles, so every pixel counts and turning both images about +Z changes nothing."""
    assert image.shape == reference.shape, (image.shape, reference.shape)
    whole = jnp.vectorize(lambda one: pad_sphere(one, WINDOW // 2), signature="(h,w,c)->(i,j,c)")
    similarity = jnp.mean(ssim_map(whole(image), whole(reference)), axis=-1)
    weights = _full(_row_weights(image.shape[-3]), similarity.shape)
    return jnp.average(similarity, axis=(-2, -1), weights=weights)


def _row_weights(height: int) -> jax.Array:
    return jnp.cos(latitudes(height))[:, None]


def _full(weights: jax.Array | None, shape: tuple[int, ...]) -> jax.Array | None:
    return None if weights is None else jnp.broadcast_to(weights, shape)
