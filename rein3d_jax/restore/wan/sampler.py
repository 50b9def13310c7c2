"""From noise to clean latents: one scan over a solver's rows, with guidance and yaws between steps."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

from rein3d_jax.restore.wan.schedule import clean_of
from rein3d_jax.restore.wan.solver import Solver

Velocity = Callable[[jax.Array, Any, jax.Array], jax.Array]  # (x, control, timestep ()) -> velocity of x's shape
_WIDTH = -2  # axis of latents and control


def sample_latents(
    key: jax.Array, velocity: Velocity, noise: jax.Array, control: Any, solver: Solver, *, yaw_step: int = 0
) -> jax.Array:
    """Latents (..., h, w, c) drawn from `noise` of that shape, under `control`, arrays (..., w, c) or none.

    With `yaw_step` > 0 the network gets each step's panorama and control rolled by a random multiple of that many
    columns, so that no seam stays where it is. Solvers are linear: rolling the network's input, and its output back,
    equals rolling the whole state on from step to step and back once at the end.
    """
    steps = len(solver.sigma)
    yaws = jnp.zeros(steps, jnp.int32)
    if yaw_step:
        yaws = yaw_step * jax.random.randint(key, (steps,), 0, noise.shape[_WIDTH] // yaw_step)

    def step(state, row):
        x, x_before, clean_before, clean_two_before = state
        sigma, timestep, correct, predict, yaw = row
        rolled, rolled_control = _rolled((x, control), yaw)
        clean = clean_of(x, _rolled(velocity(rolled, rolled_control, timestep), -yaw), sigma)
        x = _combine(correct, x, x_before, clean, clean_before, clean_two_before)
        return (_combine(predict, x, clean, clean_before), x, clean, clean_before), None

    nothing = jnp.zeros_like(noise)
    rows = (*(jnp.asarray(column, noise.dtype) for column in solver), yaws)
    return jax.lax.scan(step, (noise, nothing, nothing, nothing), rows)[0][0]


def guided(velocity: Velocity, without_text: Velocity, scale: float) -> Velocity:
    """Velocity of classifier-free guidance: v = v_without + scale (v - v_without), both under the same control."""
    if scale == 1.0:
        return velocity

    def combined(x, control, timestep):
        base = without_text(x, control, timestep)
        return base + scale * (velocity(x, control, timestep) - base)

    return combined


def _rolled(tree, columns):
    return jax.tree.map(lambda x: jnp.roll(x, columns, axis=_WIDTH), tree)


def _combine(weights, *terms):
    return sum(weight * term for weight, term in zip(weights, terms, strict=True))
