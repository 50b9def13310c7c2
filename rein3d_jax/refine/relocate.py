"""Densification by relocation under a hard cap (3DGS as Markov chain Monte Carlo, Kheradmand et al. 2024).

What has become faint moves to where a Gaussian is already; the two then share its opacity so that the picture hardly
changes, and noise, strongest where opacity is low, lets them part.
"""

import math

import jax
import jax.numpy as jnp
import numpy as np

from rein3d_jax.geometry.rotations import matrix_from_quats
from rein3d_jax.refine.config import DensifyConfig, RefineConfig
from rein3d_jax.refine.densify import forget
from rein3d_jax.refine.state import RefineState

GROWTH = 0.05  # of the living, added at a time until the buffer is full (their Sec. 4.3)
MOST = 51  # copies of one Gaussian at a time, as theirs
STEEPNESS, THRESHOLD = 100.0, 0.005  # of the noise's gate on opacity (their eq. 8)


def shared(opacity: jax.Array, copies: jax.Array) -> tuple[jax.Array, jax.Array]:
    """(n,) opacity of one Gaussian, (n,) int how many (1 to MOST) shall take its place -> each one's opacity, and the
    factor of its scale. Along a line through their common centre, peak and integral of alpha stay (their eq. 9):

        o' = 1 - (1 - o)^(1/N),   s' / s = o / sum_j C(N, j) (-1)^(j - 1) o'^j / sqrt(j)
    """
    table = np.zeros((MOST + 1, MOST))
    for n in range(1, MOST + 1):
        table[n, :n] = [math.comb(n, j) * (-1) ** (j - 1) / math.sqrt(j) for j in range(1, n + 1)]
    each = -jnp.expm1(jnp.log1p(-opacity) / copies)
    powers = each[:, None] ** jnp.arange(1, MOST + 1)
    return each, opacity / jnp.sum(jnp.asarray(table, jnp.float32)[copies] * powers, axis=-1)


def _relocate(state: RefineState, key: jax.Array, *, config: DensifyConfig):
    """Move the faint, and grow by GROWTH while slots are free: (state, counts). Sources are drawn by opacity.

    The buffer is the cap; nothing can overflow it.
    """
    parameters, alive = state.parameters, state.alive
    count = alive.shape[0]
    opacity = jax.nn.sigmoid(parameters["opacity_logits"])
    faint = alive & (opacity <= config.prune_opacity)
    living = alive & ~faint
    grow = jnp.ceil(GROWTH * jnp.sum(alive))
    slots = (faint | (~alive & (jnp.cumsum(~alive) <= grow))) & jnp.any(living)
    weights = jnp.cumsum(jnp.where(living, opacity, 0.0))
    draws = jax.random.uniform(key, (count,), maxval=weights[-1])
    source = jnp.minimum(jnp.searchsorted(weights, draws, side="right"), count - 1)

    drawn = jnp.zeros(count, jnp.int32).at[jnp.where(slots, source, count)].add(1, mode="drop")
    each, factor = shared(jnp.minimum(opacity, 1 - 1e-6), jnp.minimum(drawn + 1, MOST))
    each = jnp.clip(each, config.prune_opacity, 1 - 1e-6)
    split = drawn > 0
    parameters = parameters | {
        "opacity_logits": jnp.where(split, jnp.log(each) - jnp.log1p(-each), parameters["opacity_logits"]),
        "log_scales": parameters["log_scales"] + jnp.where(split, jnp.log(factor), 0.0)[:, None],
    }
    chosen = jnp.where(slots, source, jnp.arange(count))
    moved = {name: value[chosen] for name, value in parameters.items()}
    new = state.replace(
        parameters=moved, alive=alive | slots, floor=state.floor[chosen],
        optimizer=forget(state.optimizer, slots | split),
        gradient_sum=jnp.zeros(count), seen=jnp.zeros(count),
    )  # fmt: skip
    counts = {"added": jnp.sum(slots & ~alive), "pruned": jnp.sum(slots & alive), "overflow": jnp.zeros((), jnp.int32)}
    return new, counts


def wander(state: RefineState, key: jax.Array, *, config: RefineConfig) -> jax.Array:
    """(n, 3) metres that the means move by chance after a step: along each Gaussian's own covariance, gated by low
    opacity (their eq. 8). Divided by the extent, so that the unit of length does not matter."""
    parameters = state.parameters
    opacity = jax.nn.sigmoid(parameters["opacity_logits"])
    gate = jax.nn.sigmoid(STEEPNESS * (THRESHOLD - opacity))
    decay = config.rates.means_end ** (state.step / max(config.steps, 1))
    size = config.densify.noise * config.rates.means * decay / state.extent * gate
    axes = matrix_from_quats(parameters["quats"]) * jnp.exp(parameters["log_scales"])[:, None]
    along = jnp.einsum("nji,nj->ni", axes, jax.random.normal(key, parameters["means"].shape), precision="highest")
    return jnp.einsum("nij,nj->ni", axes, along, precision="highest") * size[:, None]


relocate = jax.jit(_relocate, static_argnames=("config",))
