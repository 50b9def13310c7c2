"""Laws of the loop: it fits, repeats to the byte, and never trains on what it holds out."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.rasterize import rasterize
from rein3d_jax.refine import STOPPED, RefineConfig, blank_snapshot, refine
from rein3d_jax.refine.refine import _batches
from rein3d_jax.refine.views import camera_of

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
    np.testing.assert_array_equal(same["loss"], curves["loss"])
    for a, b in zip(jax.tree.leaves(fitted), jax.tree.leaves(again), strict=True):
        assert np.asarray(a).tobytes() == np.asarray(b).tobytes()


def test_it_goes_on_from_any_look_to_the_same_bytes(toy, config, raster) -> None:
    _, views, start = toy()
    looks = []
    whole, curves = refine(start, views, 2.0, KEY, config=config, raster=raster, on_look=looks.append)
    assert [int(look.state.step) for look in looks] == [0, 5]
    resumed, same = refine(start, views, 2.0, KEY, config=config, raster=raster, start=looks[1])
    for a, b in zip(jax.tree.leaves((whole, curves)), jax.tree.leaves((resumed, same)), strict=True):
        assert np.asarray(a).tobytes() == np.asarray(b).tobytes()
    blank = blank_snapshot(config)
    assert jax.tree.structure(blank) == jax.tree.structure(looks[1])


def test_steps_taken_at_once_are_the_same_steps(toy, config, raster) -> None:
    """Densification and looks at steps 4, 5 and 8 cut the scans."""
    _, views, start = toy()
    at_once = dataclasses.replace(config, steps_at_once=3)
    fits = [refine(start, views, 2.0, KEY, config=c, raster=raster) for c in (config, at_once)]
    np.testing.assert_allclose(*(np.asarray(curves["loss"]) for _, curves in fits), rtol=1e-4)  # other compilation
    for a, b in zip(*(jax.tree.leaves(scene) for scene, _ in fits), strict=True):
        np.testing.assert_allclose(a, b, atol=2e-3)  # Adam divides by gradients near 0: rounding gets a rate


def test_it_stops_where_looks_stop_improving(toy, config, raster) -> None:
    _, views, start = toy()
    greedy = dataclasses.replace(config, plateau=50.0, patience=1, evaluate_every=2)  # no look brings 50 dB
    _, curves = refine(start, views, 2.0, KEY, config=greedy, raster=raster)
    assert STOPPED[int(curves["stopped"])] == "held-out views stopped improving"
    assert curves["psnr"][:, 0].tolist() == [0, 2] and len(curves["loss"]) == 2
    _, curves = refine(start, views, 2.0, KEY, config=config, raster=raster)
    assert STOPPED[int(curves["stopped"])] == "all steps taken"


def test_relocation_fits_too(toy, config, raster) -> None:
    _, views, start = toy()
    chain = dataclasses.replace(config, densification="mcmc", opacity_weight=0.01, scale_weight=0.01)
    fitted, curves = refine(start, views, 2.0, KEY, config=chain, raster=raster)
    assert np.mean(curves["loss"][-3:, 1]) < np.mean(curves["loss"][:3, 1])
    assert int(fitted.alive.sum()) == 45  # 5 % of 40, then of 42, rounded up, at steps 4 and 8


def test_each_source_finds_its_tint(toy, config, raster) -> None:
    """The true scene held still; a third of the views is 0.1 too bright, and its affine takes that up."""
    scene, views, _ = toy()
    scene = scene.replace(opacity_logits=scene.opacity_logits + 5, log_scales=scene.log_scales + 0.7)
    frames = [rasterize(scene, camera_of(views, i), config=raster) for i in range(len(views.rgb))]
    solid = jnp.stack([frame.alpha for frame in frames]) > 0.98  # what is behind the scene changes with each step
    tint = 0.1 * (views.source == 1)[:, None, None, None]
    tinted = views.replace(rgb=jnp.stack([frame.rgb for frame in frames]) + tint, weight=solid.astype(float))
    names = ("means", "scales", "opacities", "quats", "sh", "sh_rest")
    still = {f"{name}_rate": 0.0 for name in names}
    chosen = dataclasses.replace(config, steps=100, evaluate_every=99, densify_start=1000, colour_rate=3e-3, **still)
    looks = []
    refine(scene, tinted, 2.0, KEY, config=chosen, raster=raster, on_look=looks.append)
    colour = np.asarray(looks[-1].state.colour)
    of_grey = colour[:, :, :3].sum(axis=-1) / 2 + colour[:, :, 3]
    np.testing.assert_array_equal(colour[0], np.eye(3, 4))  # the input's colours are the scene's
    np.testing.assert_allclose(of_grey[1] - of_grey[2], 0.1, atol=0.03)  # rates of 3e-3 keep it swinging


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
    assert len(curves["loss"]) == 0


def test_a_single_view_is_refused(toy, config, raster) -> None:
    _, views, start = toy()
    with pytest.raises(InputError, match="1 view leaves none to train on"):
        refine(start, jax.tree.map(lambda x: x[:1], views), 2.0, KEY, config=config, raster=raster)


@pytest.mark.parametrize(
    ("key", "value"),
    [("batch", 0), ("test_every", 1), ("crop", 8), ("sh_degree", 4), ("fov", 170.0), ("steps", -1), ("reset_every", 0),
     ("steps_at_once", 0), ("densification", "magic")],
)
def test_bad_values_are_refused_by_name(key, value) -> None:
    with pytest.raises(InputError, match=f"refine.{key}"):
        RefineConfig(**{key: value})
