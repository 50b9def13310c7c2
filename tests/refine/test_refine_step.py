"""Laws of one optimisation step."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.refine.state import initial_state
from rein3d_jax.refine.step import Chance, take_step

FIRST = Chance(jnp.array([1, 2]), jnp.zeros(3), jax.random.key(0))
EXTENT = 2.0


@pytest.fixture
def step(config, raster, buffers):
    """(state, views) -> one step on views 1 and 2, before black."""
    return partial(take_step, chance=FIRST, config=config, raster=raster, buffers=buffers)


def test_a_step_moves_what_is_seen_and_stays_finite(toy, config, step) -> None:
    _, views, start = toy()
    state = initial_state(start, config, extent=EXTENT)
    new, metrics = step(state, views)
    assert not metrics["skipped"] and int(metrics["overflow"]) == 0 and int(new.step) == 1
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(new))
    moved = np.any(np.asarray(new.parameters["sh"] != state.parameters["sh"]), axis=(1, 2))
    np.testing.assert_array_equal(moved, np.asarray(new.seen) > 0)
    assert not np.any(moved[~np.asarray(state.alive)]) and moved.any()
    np.testing.assert_array_equal(new.parameters["sh_rest"], state.parameters["sh_rest"])  # degree 1 waits


def test_a_batch_without_finite_gradient_changes_nothing_and_is_counted(toy, config, step) -> None:
    _, views, start = toy()
    state = initial_state(start, config, extent=EXTENT)
    batch = views.replace(rgb=views.rgb.at[2, 7, 7, 0].set(jnp.nan))
    new, metrics = step(state, batch)
    assert metrics["skipped"] and int(new.step) == 1
    for before, after in zip(jax.tree.leaves(state.replace(step=new.step)), jax.tree.leaves(new), strict=True):
        np.testing.assert_array_equal(before, after)


def test_a_step_does_not_depend_on_the_unit_of_length(toy, config, step) -> None:
    """Scene, poses and extent times 10 give the scene times 10."""
    scale, states = 10.0, []
    for factor in (1.0, scale):
        _, views, start = toy(factor)
        state = initial_state(start, config, extent=EXTENT * factor)
        states.append(step(state, views)[0].parameters)
    small, large = states
    comparable = large | {"means": large["means"] / scale, "log_scales": large["log_scales"] - np.log(scale)}
    rates = {
        "means": EXTENT * config.rates.means, "log_scales": config.rates.scales, "quats": config.rates.quats,
        "opacity_logits": config.rates.opacities, "sh": config.rates.sh, "sh_rest": config.rates.sh_rest,
    }  # fmt: skip
    for name, rate in rates.items():
        # Adam's first step is rate x sign(gradient). Rounding is 1e-6 of a coordinate, under 1 % of each rate; where
        # the gradient itself is nothing but rounding its sign is anyone's: few are.
        differs = np.abs(np.asarray(comparable[name] - small[name])) > 0.01 * rate + 1e-6
        assert differs.mean() < 0.02, name


def test_no_two_leaves_of_a_first_state_are_one_buffer(toy, config) -> None:
    """XLA refuses to be given one buffer twice, as a step that uses its state up would."""
    leaves = jax.tree.leaves(initial_state(toy()[2], config, extent=EXTENT))
    assert len({leaf.unsafe_buffer_pointer() for leaf in leaves if leaf.size}) == sum(leaf.size > 0 for leaf in leaves)
