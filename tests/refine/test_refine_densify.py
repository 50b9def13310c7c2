"""Laws of growing and pruning in buffers of fixed size."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from rein3d_jax.refine.densify import RESET_OPACITY, SHRINK, densify, reset_opacity
from rein3d_jax.refine.state import RefineState, initial_state

KEY = jax.random.key(0)


def state_of(toy, config) -> RefineState:
    """Every slot remembers something, and Gaussians 0, 3, 6, ... want to grow, the first ones most."""
    state = initial_state(toy()[2], config, extent=2.0)
    count = state.alive.shape[0]
    moments = jax.tree.map(lambda x: jnp.ones_like(x) if x.ndim and x.shape[0] == count else x, state.optimizer)
    pull = jnp.where(jnp.arange(count) % 3 == 0, 1.0 - jnp.arange(count) / 1000, 0.0)
    return state.replace(optimizer=moments, gradient_sum=2 * pull, seen=jnp.full(count, 2.0))


def wanted(state) -> np.ndarray:
    return np.asarray((state.gradient_sum > 0) & state.alive)


def remembers(state) -> np.ndarray:
    """(n,) whether any moment of a slot is not zero."""
    count = state.alive.shape[0]
    leaves = [x for x in jax.tree.leaves(state.optimizer) if x.ndim and x.shape[0] == count]
    return np.any([np.asarray(x).reshape(count, -1).any(axis=1) for x in leaves], axis=0)


def test_dead_slots_are_used_and_the_count_adds_up(toy, config) -> None:
    before = state_of(toy, config)
    after, counts = densify(before, KEY, config=config.densify)
    added, pruned, overflow = (int(counts[name]) for name in ("added", "pruned", "overflow"))
    assert int(after.alive.sum()) == int(before.alive.sum()) + added - pruned
    assert added == wanted(before).sum() and overflow == 0 and pruned == 0
    assert np.all(np.asarray(after.alive)[np.asarray(before.alive)])
    assert not np.any(after.gradient_sum) and not np.any(after.seen)
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(after))


def test_without_a_free_slot_growth_is_counted_as_overflow(toy, config) -> None:
    before = state_of(toy, config)
    before = before.replace(alive=jnp.ones_like(before.alive))
    after, counts = densify(before, KEY, config=config.densify)
    assert int(counts["added"]) == 0 and int(counts["overflow"]) == wanted(before).sum()
    for name, value in before.parameters.items():
        np.testing.assert_array_equal(after.parameters[name], value)  # and nobody was split in place


def test_a_split_keeps_its_place_and_shrinks(toy, config) -> None:
    before = state_of(toy, config)
    after, counts = densify(before, KEY, config=dataclasses.replace(config.densify, split_size=1e-6))
    parents, children = np.flatnonzero(wanted(before)), np.flatnonzero(np.asarray(after.alive & ~before.alive))
    assert len(children) == len(parents) == int(counts["added"])
    old, new = before.parameters, after.parameters
    for slots in (parents, children):
        np.testing.assert_allclose(new["log_scales"][slots], old["log_scales"][parents] - np.log(SHRINK), atol=1e-6)
        np.testing.assert_array_equal(new["sh"][slots], old["sh"][parents])
    # Two draws from the parent: their mean is off by sigma / sqrt(2) an axis, by 3 sigma with odds under 1e-4.
    middle = (new["means"][parents] + new["means"][children]) / 2
    sigma = np.exp(np.asarray(old["log_scales"][parents]).max(axis=-1))
    assert np.all(np.linalg.norm(middle - old["means"][parents], axis=-1) < 3 * sigma)
    assert np.all(np.linalg.norm(new["means"][parents] - new["means"][children], axis=-1) > 0)
    fresh = np.zeros_like(remembers(after))
    fresh[np.concatenate([parents, children])] = True
    assert not np.any(remembers(after)[fresh]) and np.all(remembers(after)[~fresh])


def test_a_clone_copies_and_its_original_remembers(toy, config) -> None:
    before = state_of(toy, config)
    after, _ = densify(before, KEY, config=dataclasses.replace(config.densify, split_size=100.0))
    parents, children = np.flatnonzero(wanted(before)), np.flatnonzero(np.asarray(after.alive & ~before.alive))
    for name, value in before.parameters.items():
        np.testing.assert_array_equal(after.parameters[name][parents], value[parents])
        np.testing.assert_array_equal(after.parameters[name][children], value[parents])  # the steepest go first
    assert np.all(remembers(after)[parents]) and not np.any(remembers(after)[children])


def test_the_faint_are_pruned_and_forgotten(toy, config) -> None:
    before = state_of(toy, config)
    logits = before.parameters["opacity_logits"].at[1].set(-10.0)  # opacity 5e-5
    before = before.replace(parameters=before.parameters | {"opacity_logits": logits})
    after, counts = densify(before, KEY, config=config.densify)
    assert int(counts["pruned"]) == 1 and not after.alive[1] and not remembers(after)[1]


def test_a_reset_caps_opacity_and_forgets_only_its_moments(toy, config) -> None:
    before = state_of(toy, config)
    after = reset_opacity(before)
    opacity = jax.nn.sigmoid(after.parameters["opacity_logits"])
    assert np.all(opacity <= RESET_OPACITY * (1 + 1e-5))  # float32
    assert np.all(opacity > config.densify.prune_opacity)  # a reset alone prunes nothing
    assert not any(np.any(x) for x in jax.tree.leaves(after.optimizer.inner_states["opacity_logits"]) if x.ndim)
    for name in ("means", "sh"):
        np.testing.assert_array_equal(after.parameters[name], before.parameters[name])
        assert all(np.all(x == 1) for x in jax.tree.leaves(after.optimizer.inner_states[name]) if x.ndim)
