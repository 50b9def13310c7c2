"""Laws of the network: it starts as the fills' mean, knows neither seam nor metres nor the order of frames."""

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.restore.learned.attention import dot_product_attention, rotary_angles, rotate_halves
from rein3d_jax.restore.learned.augment import mirrored, yawed
from rein3d_jax.restore.learned.condition import CANDIDATES, FEATURES, Clip, network_features
from rein3d_jax.restore.learned.config import TOKEN, NetworkConfig
from rein3d_jax.restore.learned.convolution import fold, unfold, wrap
from rein3d_jax.restore.learned.loss import Example
from rein3d_jax.restore.learned.mixture import base
from rein3d_jax.restore.learned.network import Network, initial_parameters
from rein3d_jax.restore.learned.predict import predict

ROWS, FRAMES = 16, 3
CONFIG = NetworkConfig(rows=ROWS, fine=16, width=16, depth=1, heads=2, expand=1)
LEVEL = jnp.array([0.7])
START = initial_parameters(jax.random.key(0), CONFIG)
ATOL = 2e-5  # float32 through about ten layers, of values near 1


def perturbed(parameters, size=0.2):
    """No leaf is left at 0: a zero head would hold every law."""
    leaves, structure = jax.tree.flatten(parameters)
    keys = jax.random.split(jax.random.key(1), len(leaves))
    moved = [x + size * jax.random.normal(key, x.shape) for x, key in zip(leaves, keys, strict=True)]
    return jax.tree.unflatten(structure, moved)


PARAMETERS = perturbed(START)


def example_of(rows=ROWS, frames=FRAMES) -> Example:
    rng = np.random.default_rng(0)
    shape = (frames, rows, 2 * rows)

    def values(*channels):
        return jnp.asarray(rng.random((*shape, *channels), np.float32))

    alpha = (values() < 0.7).astype(jnp.float32).at[0].set(1.0)
    position = jnp.asarray(rng.normal(size=(frames, 3)).astype(np.float32)).at[0].set(0.0)
    clip = Clip(values(3), alpha, (1 + values()) * alpha, values(CANDIDATES, 3), 1 + values(CANDIDATES), position)
    return Example(clip, values(3), 1 + values())


def noise(rows=ROWS, frames=FRAMES):
    return 0.2 * jax.random.normal(jax.random.key(2), (frames, rows, 2 * rows, 4))


@partial(jax.jit, static_argnames="config")
def predicted(parameters, clip, noisy, config=CONFIG):
    """predict() of one clip (t, h, w)."""
    clips = jax.tree.map(lambda x: x[None], clip)
    return predict(parameters, clips, noisy[None], LEVEL, config=config)[0]


@pytest.mark.parametrize("rows", [ROWS, 2 * ROWS])
def test_the_network_starts_as_the_fills_mean_and_no_more_once_it_has_learnt(rows):
    clip, noisy = example_of(rows).clip, noise(rows)
    # A softmax of zeros and a mean: thirds of values up to 1 (colours, log 2), summed in two orders.
    np.testing.assert_allclose(predicted(START, clip, noisy), 0.0, atol=3e-7)
    moved = predicted(PARAMETERS, clip, noisy)
    assert moved.shape == noisy.shape and np.isfinite(moved).all() and np.abs(moved).mean() > 0.05


@pytest.mark.parametrize("rows", [ROWS, 2 * ROWS])
def test_a_yaw_by_a_multiple_of_the_token_commutes(rows):
    """In columns of the full picture, which is halved until it has the network's rows."""
    example, noisy = example_of(rows), noise(rows)
    columns = 3 * TOKEN * rows // ROWS
    moved = predicted(PARAMETERS, yawed(example, columns).clip, jnp.roll(noisy, columns, axis=2))
    before = predicted(PARAMETERS, example.clip, noisy)
    np.testing.assert_allclose(moved, jnp.roll(before, columns, axis=2), atol=ATOL)
    still = predicted(PARAMETERS, example.clip, jnp.roll(noisy, columns, axis=2))
    assert np.abs(still - jnp.roll(before, columns, axis=2)).max() > 0.01


def test_metres_twice_as_long_double_the_distances_and_leave_the_colours():
    clip, noisy = example_of().clip, noise()
    long = clip.replace(distance=2 * clip.distance, fill_distance=2 * clip.fill_distance, position=2 * clip.position)
    before, after = (predicted(PARAMETERS, x, noisy) + base(x) for x in (clip, long))
    np.testing.assert_allclose(after[..., :3], before[..., :3], atol=ATOL)
    np.testing.assert_allclose(after[..., 3], before[..., 3] + np.log(2), atol=ATOL)


def test_frames_in_another_order_are_restored_in_that_order():
    """All but the anchor, which stays first: time enters through places alone."""
    clip, noisy, order = example_of(frames=4).clip, noise(frames=4), np.array([0, 3, 1, 2])
    before = predicted(PARAMETERS, clip, noisy)
    after = predicted(PARAMETERS, jax.tree.map(lambda x: x[order], clip), noisy[order])
    np.testing.assert_allclose(after, before[order], atol=ATOL)


@pytest.mark.parametrize("anchor", [True, False])
def test_frames_attend_to_the_anchor_or_it_is_as_if_it_were_not_there(anchor):
    config = replace(CONFIG, anchor=anchor)
    given = jax.random.normal(jax.random.key(3), (1, FRAMES, ROWS, 2 * ROWS, FEATURES))
    run = jax.jit(lambda x: Network(config).apply({"params": PARAMETERS}, x, LEVEL)[:, 1:])
    change = np.abs(run(given) - run(given.at[:, 0].set(0.0))).max()
    assert change > 0.01 if anchor else change == 0


def test_the_network_compiles_for_every_platform():
    clips = jax.tree.map(lambda x: x[None], example_of().clip)
    given = (PARAMETERS, clips, noise()[None], LEVEL)
    exported = jax.export.export(jax.jit(partial(predict, config=CONFIG)), platforms=("cpu", "cuda", "tpu"))(*given)
    assert exported.platforms == ("cpu", "cuda", "tpu")
    np.testing.assert_allclose(exported.call(*given)[0], predicted(PARAMETERS, clips_first(clips), noise()), atol=ATOL)


def clips_first(clips):
    return jax.tree.map(lambda x: x[0], clips)


@pytest.mark.parametrize("columns", [1, 5, -7])
def test_an_example_after_a_yaw_has_rolled_features(columns):
    example, noisy = example_of(), noise()
    moved = network_features(yawed(example, columns).clip, jnp.roll(noisy, columns, axis=2))
    before = network_features(example.clip, noisy)
    assert before.shape[-1] == FEATURES
    np.testing.assert_allclose(moved, jnp.roll(before, columns, axis=2), atol=1e-5)  # a float32 rotation of 3 m


def test_mirrored_twice_or_rotated_all_around_is_the_same_example():
    example = example_of()
    jax.tree.map(np.testing.assert_array_equal, mirrored(mirrored(example)), example)
    assert not np.array_equal(mirrored(example).clip.rgb, example.clip.rgb)
    around = partial(np.testing.assert_allclose, atol=1e-6)  # positions: the sine of a float32 2 pi is 2e-7
    jax.tree.map(around, yawed(example, 2 * ROWS), example)
    jax.tree.map(around, yawed(yawed(example, 5), -5), example)


@pytest.mark.parametrize("size", [2, 4])
def test_unfold_undoes_fold(size):
    grid = np.random.default_rng(0).random((2, 8, 16, 3))
    folded = fold(grid, size)
    assert folded.shape == (2, 8 // size, 16 // size, 3 * size**2)
    np.testing.assert_array_equal(unfold(folded, size), grid.astype(np.float32))
    np.testing.assert_array_equal(
        folded[0, 1, 1].reshape(size, size, 3), np.float32(grid[0, size:, size:])[:size, :size]
    )


def test_a_wrapped_grid_goes_on_at_the_seam_and_repeats_a_poles_row():
    grid = np.random.default_rng(0).random((2, 3, 6, 1)).astype(np.float32)
    wide = wrap(grid)
    np.testing.assert_array_equal(wide, np.pad(np.pad(grid, NO_ROWS, "wrap"), NO_COLUMNS, "edge"))
    np.testing.assert_array_equal(wrap(np.roll(grid, 2, axis=2))[:, :, 1:-1], np.roll(wide[:, :, 1:-1], 2, axis=2))


NO_ROWS, NO_COLUMNS = ((0, 0), (0, 0), (1, 1), (0, 0)), ((0, 0), (1, 1), (0, 0), (0, 0))


def test_attention_is_a_softmax_and_knows_no_first_column():
    rows, columns, heads, size = 2, 6, 2, 8
    query, key, value = jax.random.normal(jax.random.key(4), (3, rows * columns, heads, size))
    angles = rotary_angles(rows, columns, size)

    def attended(query, key, value):
        return dot_product_attention(rotate_halves(query, angles), rotate_halves(key, angles), value)

    def rolled(x):
        return jnp.roll(x.reshape(rows, columns, heads, size), 2, axis=1).reshape(x.shape)

    after = attended(*map(rolled, (query, key, value)))
    np.testing.assert_allclose(after, rolled(attended(query, key, value)), atol=1e-5)  # float32 sums of 8 and of 12
    scores = np.exp(np.einsum("nhd,mhd->nmh", query, key) / np.sqrt(size))
    expected = np.einsum("nmh,mhd->nhd", scores / scores.sum(axis=1, keepdims=True), value)
    np.testing.assert_allclose(dot_product_attention(query, key, value), expected, atol=1e-5)


def test_bfloat16_stays_near_float32():
    """8 bits of mantissa, 2^-9 = 2e-3 a rounding, through the ten layers that ATOL speaks of; measured 7e-3."""
    clips = jax.tree.map(lambda x: x[None], example_of().clip)
    exact, found = (
        jax.jit(partial(predict, config=CONFIG, dtype=dtype))(PARAMETERS, clips, noise()[None], LEVEL)
        for dtype in (jnp.float32, jnp.bfloat16)
    )
    assert found.dtype == jnp.float32
    assert 0 < jnp.linalg.norm(found - exact) / jnp.linalg.norm(exact) < 0.03
