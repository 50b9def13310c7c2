"""From noise to clean latents: one scan over a solver's rows, with guidance and with turns between steps."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

from rein3d_jax.restore.wan.schedule import clean_of
from rein3d_jax.restore.wan.solver import Solver

Velocity = Callable[[jax.Array, Any, jax.Array], jax.Array]  # (x, control, timestep ()) -> velocity of x's shape
WIDTH = -2  # axis of latents and control


def sample(
    key: jax.Array, velocity: Velocity, noise: jax.Array, control: Any, solver: Solver, *, turn_by: int = 0
) -> jax.Array:
    """Latents (..., h, w, c) drawn from `noise` of that shape, under `control`, arrays (..., w, c) or none.

    `turn_by` > 0 lets the network see each step's panorama turned by a random multiple of that many columns, control
    and all, so that no seam stays where it is. Solvers are linear: turning what the network sees, and its answer back,
    equals turning the whole state on from step to step with one turn back at the end.
    """
    steps = len(solver.sigma)
    turns = jnp.zeros(steps, jnp.int32)
    if turn_by:
        turns = turn_by * jax.random.randint(key, (steps,), 0, noise.shape[WIDTH] // turn_by)

    def step(state, row):
        x, x_before, clean_before, clean_two_before = state
        sigma, timestep, correct, predict, turn = row
        seen, shown = _turned((x, control), turn)
        clean = clean_of(x, _turned(velocity(seen, shown, timestep), -turn), sigma)
        x = _combine(correct, x, x_before, clean, clean_before, clean_two_before)
        return (_combine(predict, x, clean, clean_before), x, clean, clean_before), None

    nothing = jnp.zeros_like(noise)
    rows = (*(jnp.asarray(column, noise.dtype) for column in solver), turns)
    return jax.lax.scan(step, (noise, nothing, nothing, nothing), rows)[0][0]


def guided(velocity: Velocity, without_text: Velocity, scale: float) -> Velocity:
    """Classifier-free guidance: v = v_without + scale (v - v_without), both under the same control."""
    if scale == 1.0:
        return velocity

    def combined(x, control, timestep):
        base = without_text(x, control, timestep)
        return base + scale * (velocity(x, control, timestep) - base)

    return combined


def _turned(tree, columns):
    return jax.tree.map(lambda x: jnp.roll(x, columns, axis=WIDTH), tree)


def _combine(weights, *terms):
    return sum(weight * term for weight, term in zip(weights, terms, strict=True))
