"""Laws of relocation under a hard cap."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.refine.relocate import MOST, relocate, shared, wander
from rein3d_jax.refine.state import initial_state

EXTENT = 2.0
KEY = jax.random.key(0)


@pytest.mark.parametrize("copies", [1, 2, 5, MOST])
def test_copies_in_one_place_show_what_the_one_did(copies) -> None:
    """Peak and integral of alpha along a line through the centre, by quadrature."""
    opacity = jnp.array([0.1, 0.6, 0.99])
    each, factor = (np.asarray(x, np.float64) for x in shared(opacity, jnp.full(3, copies)))
    x = np.linspace(-12, 12, 20001)
    one = np.asarray(opacity)[:, None] * np.exp(-(x**2) / 2)
    many = 1 - (1 - each[:, None] * np.exp(-((x / factor[:, None]) ** 2) / 2)) ** copies
    np.testing.assert_allclose(many.max(axis=1), one.max(axis=1), rtol=1e-4)  # float32 power of up to 51
    np.testing.assert_allclose(many.sum(axis=1), one.sum(axis=1), rtol=2e-3)  # an alternating sum in float32


def faint(toy, config, count: int):
    """A state with the first `count` Gaussians faded, whose every slot remembers something."""
    state = initial_state(toy()[2], config, extent=EXTENT)
    slots = state.alive.shape[0]
    moments = jax.tree.map(lambda x: jnp.ones_like(x) if x.ndim and x.shape[0] == slots else x, state.optimizer)
    logits = state.parameters["opacity_logits"].at[:count].set(-8.0)
    return state.replace(parameters=state.parameters | {"opacity_logits": logits}, optimizer=moments)


def test_the_faint_move_onto_the_living_and_the_cap_holds(toy, config) -> None:
    before = faint(toy, config, 7)
    after, counts = relocate(before, KEY, config=config.densify)
    assert int(counts["pruned"]) == 7 and int(counts["overflow"]) == 0
    assert int(after.alive.sum()) == int(before.alive.sum()) + int(counts["added"])
    assert int(counts["added"]) == 2  # 5 % of 40
    places = np.asarray(before.parameters["means"])[7:40]
    for slot in range(7):
        assert np.any(np.all(np.asarray(after.parameters["means"][slot]) == places, axis=-1))
    assert np.all(np.isfinite(jax.tree.leaves(after.parameters)[0]))
    for _ in range(30):
        after, counts = relocate(after, KEY, config=config.densify)
    assert bool(after.alive.all()) and int(counts["added"]) == 0  # full, and no more


def test_what_moved_or_shared_forgets_and_others_remember(toy, config) -> None:
    before = faint(toy, config, 7)
    after, _ = relocate(before, KEY, config=config.densify)
    changed = np.any(np.asarray(after.parameters["log_scales"] != before.parameters["log_scales"]), axis=-1)
    momentum = np.asarray(after.optimizer.inner_states["means"].inner_state[0].mu["means"])
    np.testing.assert_array_equal(momentum.any(axis=-1), ~(changed | np.asarray(after.alive & ~before.alive)))


def test_without_a_living_one_nothing_moves(toy, config) -> None:
    before = faint(toy, config, 60)
    after, counts = relocate(before, KEY, config=config.densify)
    assert int(counts["added"]) == int(counts["pruned"]) == 0
    for name, value in before.parameters.items():
        np.testing.assert_array_equal(after.parameters[name], value)


def test_noise_moves_the_faint_only_and_scales_with_the_scene(toy, config) -> None:
    config = dataclasses.replace(config, densification="mcmc")
    state = faint(toy, config, 7)
    moves = np.linalg.norm(np.asarray(wander(state, KEY, config=config)), axis=-1)
    assert moves[:7].min() > 1e3 * moves[7:40].max()  # the gate: e^-100 (0.6 - 0.005) against 1/2
    scales = state.parameters["log_scales"] + np.log(10)
    grown = state.replace(parameters=state.parameters | {"log_scales": scales}, extent=10 * state.extent)
    larger = np.linalg.norm(np.asarray(wander(grown, KEY, config=config)), axis=-1)
    np.testing.assert_allclose(larger[:7], 10 * moves[:7], rtol=1e-5)  # float32
