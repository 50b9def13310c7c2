"""Laws of the scene's buffer: what goes in stays, and what finds no slot is counted."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.lift.buffer import compact, merge, with_capacity
from rein3d_jax.scene import Gaussians


def scene(count: int, alive, offset: float = 0.0) -> Gaussians:
    """Slot i stands at x = offset + i."""
    means = jnp.zeros((count, 3)).at[:, 0].set(offset + jnp.arange(count))
    quats = jnp.tile(jnp.array([1.0, 0, 0, 0]), (count, 1))
    return Gaussians(means, jnp.zeros((count, 3)), quats, jnp.zeros(count), jnp.zeros((count, 1, 3)), jnp.array(alive))


def places(gaussians: Gaussians) -> list[float]:
    return np.asarray(gaussians.means[gaussians.alive, 0]).tolist()


def test_merging_fills_dead_slots_and_moves_nobody() -> None:
    old = scene(6, [True, False, True, False, False, True])
    merged, overflow = merge(old, scene(4, [False, True, False, True], offset=10))
    assert int(overflow) == 0
    assert places(merged) == [0, 11, 2, 13, 5]
    assert not merged.alive[4]


def test_what_finds_no_slot_is_counted() -> None:
    old = scene(6, [True, False, True, True, True, True])
    merged, overflow = merge(old, scene(4, [True, True, False, True], offset=10))
    assert int(overflow) == 2
    assert places(merged) == [0, 10, 2, 3, 4, 5]  # the first one in


def test_merging_nothing_changes_nothing() -> None:
    old = scene(6, [True, False, True, False, False, True])
    merged, overflow = merge(old, scene(4, [False] * 4, offset=10))
    assert int(overflow) == 0
    for before, after in zip(jax.tree.leaves(old), jax.tree.leaves(merged), strict=True):
        np.testing.assert_array_equal(before, after)


def test_compacting_keeps_the_living_in_order() -> None:
    old = scene(6, [True, False, True, False, False, True])
    assert places(compact(old)) == places(old) and compact(old).alive.shape == (3,)
    roomy = compact(old, capacity=6)
    assert places(roomy) == places(old) and roomy.alive.shape == (6,)


def test_new_slots_are_dead_and_finite() -> None:
    grown = with_capacity(scene(3, [True] * 3), 5)
    assert grown.alive.tolist() == [True] * 3 + [False] * 2
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(grown))
    np.testing.assert_array_equal(jnp.linalg.norm(grown.quats, axis=-1), 1.0)


def test_a_smaller_buffer_is_refused_with_the_mend() -> None:
    with pytest.raises(InputError, match=r"lift.capacity 2 < 3 pixels; raise it or lower lift.share"):
        with_capacity(scene(3, [True] * 3), 2)
