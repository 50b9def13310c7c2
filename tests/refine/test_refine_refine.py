"""Laws of the loop: it fits, repeats to the byte, and never trains on what it holds out."""

import jax
import numpy as np
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.refine import RefineConfig, refine
from rein3d_jax.refine.refine import _batches

KEY = jax.random.key(0)


def test_ten_steps_lower_the_loss_and_repeat_to_the_byte(toy, config, raster) -> None:
    _, views, start = toy()
    seen = []
    fitted, curves = refine(start, views, 2.0, KEY, config=config, raster=raster, on_step=seen.append)
    assert seen == list(range(1, config.steps + 1)) and curves["skipped"] == 0
    losses = [value for _, value in curves["loss"]]
    assert np.mean(losses[-3:]) < np.mean(losses[:3])
    assert [number for number, _ in curves["psnr"]] == [0, 5, 10]
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(fitted))
    again, same = refine(start, views, 2.0, KEY, config=config, raster=raster)
    assert same["loss"] == curves["loss"]
    for a, b in zip(jax.tree.leaves(fitted), jax.tree.leaves(again), strict=True):
        assert np.asarray(a).tobytes() == np.asarray(b).tobytes()


def test_what_is_held_out_has_no_influence(toy, config, raster) -> None:
    """Every `test_every`-th view may show anything."""
    _, views, start = toy()
    other = views.replace(rgb=views.rgb.at[:: config.test_every].set(1.0))
    fits = [refine(start, v, 2.0, KEY, config=config, raster=raster)[0] for v in (views, other)]
    for a, b in zip(*map(jax.tree.leaves, fits), strict=True):
        np.testing.assert_array_equal(a, b)


def test_batches_go_round_all_training_views(config) -> None:
    training = np.array([1, 2, 3, 5, 6, 7])
    batches = _batches(KEY, training, RefineConfig(steps=9, batch=2, crop=16))
    assert batches.shape == (9, 2)
    for turn in batches.reshape(3, -1):  # 9 batches of 2 are 3 rounds of 6
        assert sorted(turn) == training.tolist()


def test_no_step_changes_nothing(toy, config, raster) -> None:
    _, views, start = toy()
    none = RefineConfig(steps=0, batch=2, crop=16, test_every=4, sh_degree=1)
    fitted, curves = refine(start, views, 2.0, KEY, config=none, raster=raster)
    for before, after in zip(jax.tree.leaves(start), jax.tree.leaves(fitted), strict=True):
        np.testing.assert_array_equal(before, after)
    assert curves["loss"] == []


def test_a_single_view_is_refused(toy, config, raster) -> None:
    _, views, start = toy()
    with pytest.raises(InputError, match="1 view leaves none to train on"):
        refine(start, jax.tree.map(lambda x: x[:1], views), 2.0, KEY, config=config, raster=raster)


@pytest.mark.parametrize(
    ("key", "value"),
    [("batch", 0), ("test_every", 1), ("crop", 8), ("sh_degree", 4), ("fov", 170.0), ("steps", -1), ("reset_every", 0)],
)
def test_bad_values_are_refused_by_name(key, value) -> None:
    with pytest.raises(InputError, match=f"refine.{key}"):
        RefineConfig(**{key: value})
