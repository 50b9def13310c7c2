"""Laws of the loop: it fits, repeats to the byte, and never trains on what it holds out."""

import dataclasses

import jax
import numpy as np
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.refine import RefineConfig, ViewsConfig, blank_snapshot, evaluate_held_out, refine
from rein3d_jax.refine.refine import ALL_STEPS, NO_STEPS, PLATEAU, _batches

KEY = jax.random.key(0)


def same_bytes(one, other) -> bool:
    pairs = zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True)
    return all(np.asarray(a).tobytes() == np.asarray(b).tobytes() for a, b in pairs)


def test_ten_steps_lower_the_loss_and_repeat_to_the_byte(toy, fit, config) -> None:
    _, views, start = toy()
    snapshots = fit(start, views, config)
    assert [snapshot.step for snapshot in snapshots] == [0, 1, 2, 3, 4, 5, 5, 6, 7, 8, 9, 10]
    assert [snapshot.step for snapshot in snapshots if snapshot.evaluated] == [0, 5, 10]
    last = snapshots[-1]
    assert last.curves.psnr[:, 0].tolist() == [0, 5, 10] and last.curves.skipped == 0
    assert last.stopped == ALL_STEPS and not any(snapshot.stopped for snapshot in snapshots[:-1])
    losses = last.curves.loss[:, 1]
    assert np.mean(losses[-3:]) < np.mean(losses[:3])
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(last.scene))
    assert same_bytes(last, fit(start, views, config)[-1])


@pytest.mark.parametrize("number", [0, 3, 6])
def test_it_goes_on_from_any_snapshot_to_the_same_bytes(number, toy, fit, config, raster) -> None:
    """0 and 6 are held-out evaluations, which are not repeated."""
    _, views, start = toy()
    snapshots = fit(start, views, config)
    *_, last = refine(snapshots[number], views, KEY, config=config, raster=raster)
    assert same_bytes(last, snapshots[-1])
    assert jax.tree.structure(blank_snapshot(config)) == jax.tree.structure(last)


def test_a_caller_that_breaks_off_can_evaluate_what_there_is(toy, fit, config, raster) -> None:
    _, views, start = toy()
    third = fit(start, views, config)[3]
    last = evaluate_held_out(third, views, config=config, raster=raster)
    assert last.evaluated and last.curves.psnr[:, 0].tolist() == [0, 3] and same_bytes(last.scene, third.scene)
    assert evaluate_held_out(last, views, config=config, raster=raster) is last


def test_it_stops_where_evaluations_stop_improving(toy, fit, config) -> None:
    _, views, start = toy()
    greedy = dataclasses.replace(config, plateau=50.0, patience=1, evaluate_every=2)  # none brings 50 dB
    last = fit(start, views, greedy)[-1]
    assert last.stopped == PLATEAU
    assert last.curves.psnr[:, 0].tolist() == [0, 2] and len(last.curves.loss) == 2


def test_relocation_fits_too(toy, fit, config) -> None:
    _, views, start = toy()
    loss = dataclasses.replace(config.loss, opacity=0.01, scale=0.01)
    last = fit(start, views, dataclasses.replace(config, densification="mcmc", loss=loss))[-1]
    assert np.mean(last.curves.loss[-3:, 1]) < np.mean(last.curves.loss[:3, 1])
    assert int(last.scene.alive.sum()) == 45  # 5 % of 40, then of 42, rounded up, at steps 4 and 8


def test_without_densification_the_count_stays(toy, fit, config) -> None:
    _, views, start = toy()
    eager = dataclasses.replace(config.densify, gradient=0.0)
    counts = [
        fit(start, views, dataclasses.replace(config, densification=kind, densify=eager))[-1].curves.count[-1, 1]
        for kind in ("none", "default")
    ]
    assert counts[0] == start.alive.sum() < counts[1]


def test_what_is_held_out_has_no_influence(toy, fit, config) -> None:
    """Every `held_out_every`-th view may show anything."""
    _, views, start = toy()
    other = views.replace(rgb=views.rgb.at[:: config.views.held_out_every].set(1.0))
    assert same_bytes(*(fit(start, shown, config)[-1].scene for shown in (views, other)))


def test_batches_go_round_all_training_views() -> None:
    training = np.array([1, 2, 3, 5, 6, 7])
    batches = _batches(KEY, training, RefineConfig(steps=9, batch=2))
    assert batches.shape == (9, 2)
    for epoch in batches.reshape(3, -1):  # 9 batches of 2 are 3 epochs of 6
        assert sorted(epoch) == training.tolist()


def test_no_step_changes_nothing(toy, fit) -> None:
    _, views, start = toy()
    (last,) = fit(start, views, RefineConfig(steps=0, sh_degree=1, views=ViewsConfig(held_out_every=4)))
    assert same_bytes(last.scene, start) and len(last.curves.loss) == 0 and last.stopped == NO_STEPS


def test_a_single_view_is_refused(toy, fit, config) -> None:
    _, views, start = toy()
    with pytest.raises(InputError, match="1 view leaves none to train on"):
        fit(start, jax.tree.map(lambda x: x[:1], views), config)
