"""Flow matching: x_s = (1 - s) x0 + s noise, velocity v = noise - x0, timestep t = 1000 s. Lipman et al. 2023."""

import jax
import numpy as np

TIMESTEPS = 1000


def shifted(sigma, shift: float):
    """Sigma shift s / (1 + (shift - 1) s): more of the schedule at high noise, for large pictures. Arrays or floats."""
    return shift * sigma / (1 + (shift - 1) * sigma)


def sampling_sigmas(steps: int, shift: float) -> np.ndarray:
    """Sigmas (steps + 1,) float64 from just below 1 down to 0. The 1e-6 keeps log((1 - s) / s) finite."""
    sigmas = shifted(np.linspace(1, 1 / TIMESTEPS, steps + 1)[:-1], shift)
    sigmas[0] -= 1e-6
    return np.append(sigmas, 0.0)


def timesteps_of(sigmas: np.ndarray) -> np.ndarray:
    """Timesteps of all sigmas but the last: whole numbers, cut and not rounded, as in training."""
    return (sigmas[:-1] * TIMESTEPS).astype(np.int64)


def noised(clean: jax.Array, noise: jax.Array, sigma: jax.Array) -> jax.Array:
    """Noisy x_s = (1 - s) x0 + s noise."""
    return (1 - sigma) * clean + sigma * noise


def velocity_of(clean: jax.Array, noise: jax.Array) -> jax.Array:
    """Velocity v = noise - x0, what the network learns."""
    return noise - clean


def clean_of(x: jax.Array, velocity: jax.Array, sigma: jax.Array) -> jax.Array:
    """Clean x0 = x_s - s v."""
    return x - sigma * velocity
