"""Laws of Gaussians that stay as they are."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.lift import compact
from rein3d_jax.refine.parameters import split_parameters, with_sh_degree
from rein3d_jax.refine.state import Still, initial_state
from rein3d_jax.refine.step import Chance, take_step

CHANCE = Chance(jnp.array([0, 1]), jnp.array([0.2, 0.6, 0.9]), jax.random.key(0))
ATOL = 2e-5  # float32 sums in another order, through Adam, whose first steps do not depend on a gradient's size


def halves(scene):
    """(what may change, what stays): every second one, dead slots with the first."""
    stays = (jnp.arange(scene.alive.shape[0]) % 2 == 0) & scene.alive
    return scene.replace(alive=scene.alive & ~stays), compact(scene.replace(alive=stays))


@pytest.mark.parametrize("densification", ["default", "mcmc"])
def test_a_refinement_leaves_still_gaussians_to_the_bit(densification, toy, fit, config) -> None:
    """Steps, growing and the noise of relocation between them; the others do move."""
    _, views, start = toy()
    moving, still = halves(start)
    config = dataclasses.replace(config, densification=densification)
    last = fit(moving, views, config, Still(still, still))[-1]
    count = moving.alive.shape[0]
    wanted, found = (split_parameters(with_sh_degree(scene, config.sh_degree)) for scene in (still, last.scene))
    for name, value in wanted.items():
        np.testing.assert_array_equal(found[name][count:], value, err_msg=name)
    assert np.all(last.scene.alive[count:])
    moved = np.any(np.asarray(found["sh"][:count] != with_sh_degree(moving, 1).sh[:, :1]), axis=(1, 2))
    assert np.all((moved | ~np.asarray(last.scene.alive[:count]))[np.asarray(moving.alive)])
    assert last.curves.loss[-1, 1] < last.curves.loss[0, 1]


def test_a_step_moves_the_others_as_if_all_might(toy, config, raster, buffers) -> None:
    """Where the optimizer keeps nothing of the still ones, the others go where they went with them."""
    _, views, start = toy()
    moving, still = halves(start)
    options = {"config": config, "raster": raster, "buffers": buffers}
    free, of_free = take_step(initial_state(start, config, extent=2.0), views, CHANCE, **options)
    parted = initial_state(moving, config, extent=2.0, still=Still(still, still))
    half, of_half = take_step(parted, views, CHANCE, **options)
    np.testing.assert_allclose(of_half["loss"], of_free["loss"], rtol=1e-5)  # float32 sums in another order
    for name, value in half.parameters.items():
        np.testing.assert_allclose(value[moving.alive], free.parameters[name][moving.alive], atol=ATOL, err_msg=name)


def test_where_nothing_may_move_nothing_does(toy, fit, config) -> None:
    """A single dead slot is all that may change, and it stays dead."""
    _, views, start = toy()
    nothing = jax.tree.map(lambda x: x[-1:], start)
    assert not nothing.alive.any()
    still = compact(start)
    last = fit(nothing, views, config, Still(still, still))[-1]
    assert int(last.scene.alive.sum()) == int(start.alive.sum())
    losses = last.curves.psnr[:, 1]
    np.testing.assert_allclose(losses, losses[0], rtol=1e-6)
