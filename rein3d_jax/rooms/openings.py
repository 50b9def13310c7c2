"""Windows and doors: where there is wall for them."""

import jax
import jax.numpy as jnp

from rein3d_jax.rooms.furniture.footprints import NOWHERE, Footprint, footprints_overlap, join_footprints
from rein3d_jax.rooms.model import Openings
from rein3d_jax.rooms.plan import Plan, structure_footprints

OPENINGS = 4  # the first two are windows, then a door, then either
_TRIES = 24
_BEFORE_DOOR = 0.8  # metres that furniture leaves free
_BEFORE_WINDOW = 0.2


def draw_openings(key: jax.Array, plan: Plan, windowless: jax.Array) -> tuple[Openings, Footprint]:
    """Openings, and what furniture must leave free before them. `windowless` is the chance of a window to be left out.
    One that finds no wall is left out as well."""
    structure = structure_footprints(plan)
    absent = jax.tree.map(lambda x: jnp.full((OPENINGS, *x.shape[1:]), NOWHERE), structure)

    def cut(taken, row):
        index, row_key = row
        tries_key, there_key, kind_key = jax.random.split(row_key, 3)
        window = (index < 2) | ((index == 3) & jax.random.bernoulli(kind_key, 0.5))
        tries = jax.vmap(lambda k: _candidate(k, plan, window))(jax.random.split(tries_key, _TRIES))
        fits = ~jnp.any(jax.vmap(lambda one: footprints_overlap(one, taken))(tries[1]), axis=-1) & tries[2]
        missing = jnp.where(window, windowless, jnp.where(index == 2, 0.15, 0.5))
        there = jnp.any(fits) & ~jax.random.bernoulli(there_key, missing)
        opening, before, _ = jax.tree.map(lambda x: x[jnp.argmax(fits)], tries)
        opening = opening.replace(centre=jnp.where(there, opening.centre, NOWHERE))
        before = before.replace(centre=jnp.where(there, before.centre, NOWHERE))
        return jax.tree.map(lambda x, new: x.at[index].set(new), taken, before), opening

    rows = jnp.arange(OPENINGS), jax.random.split(key, OPENINGS)
    taken, openings = jax.lax.scan(cut, join_footprints(absent, structure), rows)
    return openings, jax.tree.map(lambda x: x[:OPENINGS], taken)


def _candidate(key: jax.Array, plan: Plan, window: jax.Array) -> tuple[Openings, Footprint, jax.Array]:
    """One opening anywhere, the space before it, and whether its wall is long enough."""
    number = iter(jax.random.uniform(key, (8,)))

    def between(low, high):
        return low + (high - low) * next(number)

    wall = jnp.floor(between(0, 4)).astype(jnp.int32)
    axis, sign = wall % 2, jnp.where(wall < 2, 1.0, -1.0)
    side_low, side_high = plan.low[1 - axis], plan.high[1 - axis]
    width = jnp.where(window, between(0.6, 2.4), between(0.75, 1.0))
    middle = between(side_low + width / 2 + 0.1, side_high - width / 2 - 0.1)
    full = between(0, 1) < 0.25  # a French window
    sill = jnp.where(window, jnp.where(full, 0.08, between(0.7, 1.1)), 0.0)
    tall = plan.high[2] - plan.low[2]
    top = jnp.minimum(jnp.where(window, between(1.9, 2.4), 2.03), tall - 0.12)
    depth = jnp.where(window, between(0.06, 0.3), 0.05)
    # The box begins a little inside the room, so that the wall's plane passes through it.
    face = jnp.where(sign > 0, plan.high[axis], plan.low[axis])
    inside = 0.02
    out = jnp.array([sign * (depth - inside) / 2 + face, middle])
    half = jnp.array([(depth + inside) / 2, width / 2])
    panes = jnp.array(
        [jnp.ceil(width / 0.9), jnp.where(window, jnp.where(full, 1.0, jnp.ceil((top - sill) / 1.3)), 2.0)]
    )
    opening = Openings(
        centre=jnp.append(jnp.where(axis == 0, out, out[::-1]), plan.low[2] + (sill + top) / 2),
        half=jnp.append(jnp.where(axis == 0, half, half[::-1]), (top - sill) / 2),
        wall=wall,
        window=window.astype(jnp.float32),
        panes=panes,
    )
    free = jnp.where(window, _BEFORE_WINDOW, _BEFORE_DOOR)
    spot, size = jnp.array([face - sign * free / 2, middle]), jnp.array([free / 2, width / 2 + 0.08])
    spot, size = jnp.where(axis == 0, spot, spot[::-1]), jnp.where(axis == 0, size, size[::-1])
    before = Footprint(spot, size, jnp.array([1.0, 0.0]), jnp.stack([sill, top]))
    return opening, before, (side_high - side_low > width + 0.3) & (middle > side_low) & (middle < side_high)
