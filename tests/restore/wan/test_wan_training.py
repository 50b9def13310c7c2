"""What is trained, and for what: the loss of a known velocity, its weights, adapter and LoRA, and two steps of each."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.restore.wan.config import TINY, WanConfig
from rein3d_jax.restore.wan.dit import Dit
from rein3d_jax.restore.wan.training.lora import LoraConfig, LoraPair, merge_lora, start_pairs
from rein3d_jax.restore.wan.training.memory import count, dit_shapes
from rein3d_jax.restore.wan.training.objective import (
    FlowTarget,
    ObjectiveConfig,
    flow_loss,
    flow_target,
    latent_weights,
)
from rein3d_jax.restore.wan.training.trainable import TRAINABLE_PARTS, TrainableConfig, assemble, start_training

KEY = jax.random.key(0)
SHALLOW = replace(TINY.dit, depth=2, control_every=1)  # a main block a step: gradients compile sooner
LORA = LoraConfig(rank=3, kernels=("query", "ffn_in"))
TARGET = FlowTarget(*(jax.random.normal(KEY, (2, 3, 4, 8, c)) for c in (16, SHALLOW.control_channels)))
KEYS = jax.random.split(KEY, 2)


@jax.jit
def sums(off, target, keys):
    """Of the loss of who knows x_0, and so the velocity (x - x_0) / s, but is `off` by something."""

    def known(x, timestep, control):
        return (x - target.clean) / (timestep[:, None, None, None, None] / 1000) + off

    return jnp.stack(flow_loss(known, target, keys, ObjectiveConfig()))


def mean(off):
    total, weight = sums(jnp.broadcast_to(off, TARGET.clean.shape), TARGET, KEYS)
    return total / weight


leaves = jax.tree_util.tree_leaves_with_path


def trainable(part):
    return TrainableConfig(part, LORA)


def test_the_loss_of_a_velocity_that_is_off_by_one_is_one():
    # Float32 sums of N = 3,072 numbers, none negative: sqrt(N) eps = 7e-6 of themselves.
    np.testing.assert_allclose([mean(0.0), mean(1.0)], [0, 1], atol=2e-5)


def test_the_anchor_counts_nothing_and_poles_count_little():
    rows = 0.1 + 0.9 * np.cos(np.radians([67.5, 22.5, -22.5, -67.5]))
    off = jnp.zeros(TARGET.clean.shape)
    assert mean(off.at[:, 0].set(1.0)) < 1e-6
    found = [mean(off.at[:, 2, row].set(1.0)) for row in range(4)]
    np.testing.assert_allclose(found, rows / rows.sum() / 2, rtol=1e-4)  # one frame of two; float32


def test_lambda_1_weighs_all_rows_alike_and_lambda_0_by_area():
    np.testing.assert_array_equal(latent_weights(2, 8, 1.0)[1], 1)
    np.testing.assert_allclose(latent_weights(2, 512, 0.0)[1].mean(), 2 / np.pi, rtol=1e-5)  # the mean of a cosine


def test_a_batch_in_parts_has_the_sums_of_the_whole():
    """Each clip has a key of its own, so its noise does not depend on its place."""
    first, second = (
        jax.tree.map(lambda x, i=i: x[i : i + 1], (TARGET.control[..., :16], TARGET, KEYS)) for i in (0, 1)
    )
    whole = sums(TARGET.control[..., :16], TARGET, KEYS)
    # Two float32 sums of N = 3,072 squares, none negative: each off by sqrt(N) eps = 7e-6 of itself in any order.
    np.testing.assert_allclose(sums(*first) + sums(*second), whole, rtol=2e-5)


def test_a_target_holds_the_clean_frame_0_and_then_the_clean_clip():
    def encode(video):
        return jnp.tile(video[:, ::4, ::8, ::8], 6)[..., :16]

    clean, rgb = jax.random.uniform(KEY, (2, 2, 5, 16, 32, 3))
    target = jax.jit(lambda clean, rgb: flow_target(encode, clean, rgb, rgb[..., 0], stride=8))(clean, rgb)
    np.testing.assert_array_equal(target.clean[:, 1:], encode(2 * clean - 1))
    for latents in (target.clean, target.control):  # the anchor, once to be noised, once as control
        np.testing.assert_array_equal(latents[:, 0, ..., :16], encode(2 * clean[:, :1] - 1)[:, 0])
    assert target.control.shape == (2, 3, 2, 4, 96)


def test_the_adapter_is_what_vace_adds_to_wan():
    shapes = dit_shapes(WanConfig().dit)
    adapter, wan = start_training(KEY, shapes, TrainableConfig("adapter"))
    assert (count(adapter), count(wan)) == (2_153_972_032 - 1_418_996_800, 1_418_996_800)


@pytest.mark.parametrize("part", TRAINABLE_PARTS)
def test_training_starts_from_the_parameters_to_the_bit(shallow_dit, part):
    start = assemble(*start_training(KEY, shallow_dit, trainable(part)), trainable(part))
    jax.tree.map(np.testing.assert_array_equal, start, shallow_dit)


def test_merged_kernels_are_the_base_and_a_path_of_low_rank_beside_it(shallow_dit):
    pairs = start_pairs(KEY, shallow_dit, LORA)
    assert {path.split("/")[-2] for path in pairs} == set(LORA.kernels)
    pairs = {path: LoraPair(pair.down, jax.random.normal(KEY, pair.up.shape)) for path, pair in pairs.items()}
    config = replace(LORA, gain=0.5)
    merged = merge_lora(shallow_dit, pairs, config)
    base, pair = shallow_dit["steps"]["control"]["ffn_in"]["kernel"][0], pairs["steps/control/ffn_in/kernel"]
    x = jax.random.normal(KEY, (5, base.shape[0]))
    beside = x @ base + 0.5 * (x @ pair.down[0]) @ pair.up[0]
    adapted = merged["steps"]["control"]["ffn_in"]["kernel"][0]
    np.testing.assert_allclose(x @ adapted, beside, atol=1e-4)  # float32, values near 5
    change = jax.tree.map(lambda a, b: a - b, merged, shallow_dit)
    assert np.linalg.matrix_rank(change["steps"]["block_0"]["ffn_in"]["kernel"][0], tol=1e-3) == LORA.rank
    rest = {name: leaf for name, leaf in change.items() if name != "steps"}
    assert not any(np.any(leaf) for leaf in jax.tree.leaves(rest))
    assert not np.any(change["steps"]["block_0"]["self_attention"]["query"]["bias"])


def test_the_default_kernels_are_those_of_every_block_of_the_published_size():
    config, shapes = LoraConfig(), dit_shapes(WanConfig().dit)
    pairs = jax.eval_shape(lambda: start_pairs(KEY, shapes, config))
    widths = {1536 + 1536: 8, 1536 + 8960: 2}  # in + out: how many kernels of a block
    assert count(pairs) == 45 * config.rank * sum(width * number for width, number in widths.items())


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: TrainableConfig("head"), 'part must be one of all, adapter, lora, not "head"'),
        (lambda: LoraConfig(rank=0), "rank must be"),
        (lambda: start_pairs(KEY, {"a": {"kernel": KEY}}, LoraConfig(kernels=("a", "spam"))), "spam"),
        (lambda: ObjectiveConfig(latitude=2.0), "latitude must be"),
        (lambda: ObjectiveConfig(shift=0.0), "shift must be"),
        (lambda: ObjectiveConfig(noise="pink"), "noise must be"),
    ],
)
def test_bad_configs_are_refused_by_name(make, named):
    with pytest.raises(InputError, match=named):
        make()


@jax.jit
def loss_and_gradient(params, text):
    def loss(params):
        def predict(x, timestep, control):
            return Dit(SHALLOW).apply({"params": params}, x, timestep, text, control)

        total, weight = flow_loss(predict, TARGET, KEYS, ObjectiveConfig())
        return total / weight

    return jax.value_and_grad(loss)(params)


@pytest.mark.slow
@pytest.mark.parametrize("part", TRAINABLE_PARTS)
def test_steps_go_down_and_move_what_is_trained_and_nothing_else(shallow_dit, golden_dit, part):
    config, optimizer, text = trainable(part), optax.sgd(0.02), jnp.asarray(golden_dit["text"])
    trained, frozen = start_training(KEY, shallow_dit, config)
    state, losses = optimizer.init(trained), []
    for _ in range(3):
        # The network's gradient is compiled once for all parts; the chain rule leads it on to what is trained.
        now, pull_back = jax.vjp(lambda trained: assemble(trained, frozen, config), trained)
        loss, gradient = loss_and_gradient(now, text)
        changes, state = optimizer.update(*pull_back(gradient), state)
        trained = optax.apply_updates(trained, changes)
        losses.append(float(loss))
    assert losses[2] < losses[1] < losses[0]  # under the same noise each time
    moved = jax.tree.map(lambda a, b: bool(np.any(a != b)), now, shallow_dit)
    names = {jax.tree_util.keystr(path, simple=True, separator="/") for path, leaf in leaves(moved) if leaf}
    if part == "all":
        assert {"embed/kernel", "steps/block_0/ffn_out/kernel", "steps/control/modulation"} <= names
    elif part == "adapter":
        heads = {"/".join(name.split("/")[: 2 if name.startswith("steps") else 1]) for name in names}
        assert heads == {"control_embed", "control_in", "steps/control", "steps/hint"}
    else:
        assert names == set(trained)
