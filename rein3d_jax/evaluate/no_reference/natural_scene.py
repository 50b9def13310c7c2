"""What pictures of the world have in common: brightness normalised by its surroundings is nearly Gaussian, and bends
away from that where a picture is spoilt. The statistics behind NIQE and BRISQUE; brightness here is 0 to 255."""

from math import lgamma
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

_WINDOW, _SIGMA = 7, 7 / 6
_STEADY = 1.0  # keeps the quotient finite where a picture is flat

_SHAPES = np.arange(0.2, 10.001, 0.001)  # the shapes that the authors' search allows
_RATIOS = np.array([np.exp(2 * lgamma(2 / a) - lgamma(1 / a) - lgamma(3 / a)) for a in _SHAPES])


class Moments(NamedTuple):
    """Of a set of values: RMS of the negative and of the positive ones, mean magnitude and mean square of all."""

    left: jax.Array
    right: jax.Array
    magnitude: jax.Array
    square: jax.Array


class Bell(NamedTuple):
    """An asymmetric generalised Gaussian: its shape (2 is normal, 1 Laplace) and the RMS of either side."""

    shape: jax.Array
    left: jax.Array
    right: jax.Array


def normalised_brightness(plane: jax.Array, *, beyond: str) -> jax.Array:
    """(I - mu) / (sigma + 1) (h, w) of a plane I (h, w) in [0, 255], mu and sigma under a 7 x 7 Gaussian window (Mittal
    et al. 2012, eq. 1-3). `beyond` the border lies a jnp.pad mode's picture: "edge", or "constant" for 0.

    Differences to the middle pixel are summed, not values and squares: exactly 0 where flat, nothing cancels.
    """
    margin = _WINDOW // 2
    padded = jnp.pad(plane, margin, mode=beyond)

    def add(sums, tap):
        weight, row, column = tap
        difference = jax.lax.dynamic_slice(padded, (row, column), plane.shape) - plane
        return (sums[0] + weight * difference, sums[1] + weight * difference**2), None

    rows, columns = np.mgrid[:_WINDOW, :_WINDOW]
    bell = np.exp(-((rows - margin) ** 2 + (columns - margin) ** 2) / (2 * _SIGMA**2))
    taps = (jnp.asarray((bell / bell.sum()).ravel(), plane.dtype), rows.ravel(), columns.ravel())
    (mean, square), _ = jax.lax.scan(add, (jnp.zeros_like(plane), jnp.zeros_like(plane)), taps)
    return -mean / (jnp.sqrt(jnp.maximum(square - mean**2, 0.0)) + _STEADY)


def moments(values: jax.Array, *, zero_is_right: bool) -> Moments:
    """Moments () of values (h, w); 0 is on the right or on neither side. NaN where a side is empty, as where flat."""

    def rms(side):
        return jnp.sqrt(jnp.sum(jnp.where(side, values**2, 0.0)) / jnp.sum(side))

    right = values >= 0 if zero_is_right else values > 0
    return Moments(rms(values < 0), rms(right), jnp.mean(jnp.abs(values)), jnp.mean(values**2))


def fit_bell(of: Moments) -> Bell:
    """Asymmetric generalised Gaussians of moments (...), shapes within [0.2, 10] (Lasmar et al. 2009). One call for
    many compiles ten times as fast as many calls."""
    skew = of.left / of.right
    ratio = of.magnitude**2 / of.square * (skew**3 + 1) * (skew + 1) / (skew**2 + 1) ** 2
    shape = jnp.interp(ratio, jnp.asarray(_RATIOS, jnp.float32), jnp.asarray(_SHAPES, jnp.float32))
    return Bell(jnp.where(jnp.isnan(ratio), jnp.nan, shape), of.left, of.right)


def width_of_deviation(shape: jax.Array) -> jax.Array:
    """A generalised Gaussian's width over its standard deviation, sqrt(Gamma(1 / a) / Gamma(3 / a)) (eq. 6)."""
    return jnp.exp((jax.lax.lgamma(1 / shape) - jax.lax.lgamma(3 / shape)) / 2)


def mean_of_width(shape: jax.Array) -> jax.Array:
    """An asymmetric generalised Gaussian's mean over the difference of its widths, Gamma(2 / a) / Gamma(1 / a)."""
    return jnp.exp(jax.lax.lgamma(2 / shape) - jax.lax.lgamma(1 / shape))


def halved(plane: jax.Array, taps: tuple[float, ...], *, beyond: str) -> jax.Array:
    """Half-size plane (h / 2, w / 2) of (h, w), both even, by an even symmetric filter `taps` between two pixels."""
    assert plane.shape[0] % 2 == plane.shape[1] % 2 == len(taps) % 2 == 0, plane.shape
    pad = len(taps) // 2 - 1
    for _ in plane.shape:  # rows, then columns
        size = plane.shape[0]
        padded = jnp.pad(plane, ((pad, pad), (0, 0)), mode=beyond)
        plane = sum(tap * padded[i : i + size : 2] for i, tap in enumerate(taps)).T
    return plane
