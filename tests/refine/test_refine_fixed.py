"""Laws of Gaussians that stay as they are."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.refine.densify import densify, reset_opacity
from rein3d_jax.refine.parameters import split_parameters, with_sh_degree
from rein3d_jax.refine.relocate import relocate
from rein3d_jax.refine.state import initial_state

KEY = jax.random.key(0)


def every_second(scene) -> jax.Array:
    return jnp.arange(scene.alive.shape[0]) % 2 == 0


@pytest.mark.parametrize("densification", ["default", "mcmc"])
def test_a_refinement_leaves_fixed_gaussians_to_the_bit(densification, toy, fit, config) -> None:
    """Steps, growing and the noise of relocation between them; the others do move."""
    _, views, start = toy()
    fixed = every_second(start)
    config = dataclasses.replace(config, densification=densification)
    last = fit(start, views, config, fixed)[-1]
    found = last.scene
    before, after = (split_parameters(with_sh_degree(scene, config.sh_degree)) for scene in (start, found))
    still = np.asarray(fixed & start.alive)
    for name, value in before.items():
        np.testing.assert_array_equal(after[name][still], value[still], err_msg=name)
    assert np.all(np.asarray(found.alive)[still])
    moved = np.asarray(start.alive & ~fixed)
    assert np.all(np.any(np.asarray(after["sh"] != before["sh"])[moved], axis=(1, 2)) | ~np.asarray(found.alive)[moved])
    assert last.curves.loss[-1, 1] < last.curves.loss[0, 1]


@pytest.mark.parametrize("change", [densify, relocate])
def test_fixed_ones_neither_grow_nor_go(change, toy, config) -> None:
    """All fixed, all steep, all faint: nothing happens, and a free slot is never fixed."""
    start = toy()[2]
    faint = start.replace(opacity_logits=start.opacity_logits - 20)
    state = initial_state(faint, config, extent=2.0, fixed=start.alive | True)
    assert not np.any(state.fixed & ~state.alive)
    state = state.replace(gradient_sum=jnp.ones_like(state.gradient_sum), seen=jnp.ones_like(state.seen))
    after, counts = change(state, KEY, config=config.densify)
    assert int(counts["added"]) == int(counts["pruned"]) == 0
    np.testing.assert_array_equal(after.alive, state.alive)
    np.testing.assert_array_equal(after.parameters["means"], state.parameters["means"])


def test_a_reset_leaves_fixed_opacities(toy, config) -> None:
    start = toy()[2]
    state = initial_state(start, config, extent=2.0, fixed=every_second(start))
    after = reset_opacity(state)
    before = np.asarray(state.parameters["opacity_logits"])
    same = np.asarray(after.parameters["opacity_logits"]) == before
    assert np.all(before > -4)  # over the opacity of a reset, 0.01
    np.testing.assert_array_equal(same, state.fixed)
