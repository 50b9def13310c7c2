"""The transformer: golden parity, the exact yaw symmetry of circular RoPE, the control branch, extreme inputs, size."""

from dataclasses import replace
from functools import partial

import jax
import jax.export
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.restore.wan.attention import attend
from rein3d_jax.restore.wan.config import TINY, DitConfig, WanConfig
from rein3d_jax.restore.wan.dit import Dit, patchify, unpatchify
from rein3d_jax.restore.wan.rotary import rotary_tables, rotate_pairs
from rein3d_jax.restore.wan.training.memory import count, dit_shapes

ROUNDING = 1e-5  # of the largest value: float32 through 6 blocks; sums change their order
CIRCULAR = replace(TINY.dit, circular=True)
PLAIN = replace(TINY.dit, control_every=0, depth=2)  # one block a step: gradients compile in a third of the time


def inputs(golden):
    return [jnp.asarray(golden[name]) for name in ("latents", "timestep", "text", "control")]


@partial(jax.jit, static_argnums=0)
def run(config, params, scale, *arguments):
    return Dit(config).apply({"params": params}, *arguments, scale)


def apply(config, golden, *arguments, scale=(1.0, 1.0)):
    return run(config, golden["params"], jnp.array(scale), *arguments)


def plain(golden):
    """The first of every two main blocks, without the control branch; (params, inputs)."""
    params = {name: leaf for name, leaf in golden["params"].items() if not name.startswith("control")}
    return params | {"steps": {"block_0": params["steps"]["block_0"]}}, inputs(golden)[:3]


@partial(jax.jit, static_argnums=0)
def loss_and_gradient(config, params, *arguments):
    def loss(params):
        return jnp.square(Dit(config).apply({"params": params}, *arguments)).mean()

    return jax.value_and_grad(loss)(params)


def gap(a, b):
    """Largest difference in units of the largest value."""
    return np.abs(a - b).max() / np.abs(b).max()


def rolled(golden, columns):
    latents, timestep, text, control = inputs(golden)
    return jnp.roll(latents, columns, axis=3), timestep, text, jnp.roll(control, columns, axis=3)


def test_it_is_what_diffusers_computes(golden_dit):
    velocity = apply(TINY.dit, golden_dit, *inputs(golden_dit), scale=golden_dit["scale"])
    assert gap(velocity, golden_dit["velocity"]) < 1e-4  # of the task; measured 5e-7


def test_a_yaw_by_whole_tokens_commutes_with_circular_rope_and_with_no_other(golden_dit):
    for config, symmetric in ((CIRCULAR, True), (TINY.dit, False)):
        straight = apply(config, golden_dit, *inputs(golden_dit))
        moved = apply(config, golden_dit, *rolled(golden_dit, 2))
        assert (gap(moved, jnp.roll(straight, 2, axis=3)) < ROUNDING) == symmetric


def test_circular_frequencies_are_whole_revolutions_and_close_to_the_trained_ones():
    grid, width = (3, 4, 56), 21 * 2
    cosine, sine = (x.reshape(*grid, 64) for x in rotary_tables(grid, 128, circular=True))
    first, second = (cosine + 1j * sine)[0, 0, :2, -width // 2 :]
    np.testing.assert_allclose((second / first) ** grid[2], 1, atol=1e-5)  # float32 to the 56th power
    trained = 1e4 ** (-np.arange(0, width, 2) / width)
    assert np.abs(np.angle(second / first) - trained).max() <= np.pi / grid[2] + 1e-6  # half a revolution, at most


def test_rotation_preserves_length_and_depends_on_differences_of_places():
    cosine, sine = rotary_tables((5, 1, 1), 12, circular=False)
    x = jax.random.normal(jax.random.key(0), (1, 1, 2, 12)).repeat(5, axis=1)
    rotated = rotate_pairs(x, cosine, sine)
    np.testing.assert_allclose(jnp.linalg.norm(rotated, axis=-1), jnp.linalg.norm(x, axis=-1), rtol=2e-6)
    products = jnp.einsum("bnhd,bmhd->hnm", rotated, rotated)
    np.testing.assert_allclose(products[:, 1:, 1:], products[:, :-1, :-1], atol=1e-5)  # |x|^2 is about 12


def test_control_acts_by_its_hints_alone(golden_dit):
    """Without them the control is forgotten; a new network's are zero, so that it begins as the one without."""
    latents, timestep, text, control = inputs(golden_dit)
    given, other = (
        apply(TINY.dit, golden_dit, latents, timestep, text, c, scale=(0.0, 0.0)) for c in (control, -control)
    )
    np.testing.assert_array_equal(given, other)
    new = jax.jit(lambda key: Dit(TINY.dit).init(key, latents, timestep, text, control)["params"]["steps"]["hint"])
    assert not any(np.any(leaf) for leaf in jax.tree.leaves(new(jax.random.key(0))))
    with pytest.raises(AssertionError, match="control"):
        Dit(TINY.dit).apply({"params": golden_dit["params"]}, latents, timestep, text)


def test_rematerialisation_and_chunks_change_neither_value_nor_gradient(golden_dit):
    params, arguments = plain(golden_dit)
    lean = replace(PLAIN, remat=True, query_chunk=7)
    plain_leaves, lean_leaves = (
        jax.tree.leaves(loss_and_gradient(config, params, *arguments)) for config in (PLAIN, lean)
    )
    for a, b in zip(plain_leaves, lean_leaves, strict=True):
        np.testing.assert_allclose(b, a, rtol=0, atol=ROUNDING * np.abs(a).max() + 1e-7)


@pytest.mark.parametrize("options", [{"chunk": 4}, {"chunk": 5}, {"kernel": "xla"}])
def test_every_attention_kernel_is_the_softmax(options):
    query, key, value = jax.random.normal(jax.random.key(0), (3, 2, 9, 3, 8))
    weights = jax.nn.softmax(jnp.einsum("bnhd,bmhd->bhnm", query, key) / 8**0.5)
    expected = jnp.einsum("bhnm,bmhd->bnhd", weights, value)
    # Logits are float32 sums of 8 products with magnitudes up to 10 in sum, over sqrt(8): off by 8^0.5 eps 10 / 8^0.5 =
    # 1e-6 in any order; so are the weights, of themselves, and with them the weighted values up to 3.
    np.testing.assert_allclose(attend(query, key, value, **options), expected, atol=5e-6)


def test_patches_come_back():
    """The head's channels are the fastest, the embedding's the slowest."""
    x, patch = jnp.arange(2 * 2 * 4 * 6 * 3.0).reshape(2, 2, 4, 6, 3), (1, 2, 2)
    tokens = patchify(x, patch).reshape(2, -1, 3, 4).swapaxes(2, 3).reshape(2, -1, 12)
    np.testing.assert_array_equal(unpatchify(tokens, (2, 2, 3), patch), x)


@pytest.mark.parametrize("value", [1.0, -1.0, 0.0])
def test_flat_inputs_give_finite_velocities_and_gradients(golden_dit, value):
    latents, timestep, text, control = inputs(golden_dit)
    latents, text, control = (jnp.full_like(x, value) for x in (latents, text, control))
    assert np.isfinite(apply(TINY.dit, golden_dit, latents, timestep, text, control)).all()
    leaves = jax.tree.leaves(loss_and_gradient(PLAIN, plain(golden_dit)[0], latents, timestep, text))
    assert all(np.isfinite(leaf).all() for leaf in leaves)


def test_bfloat16_stays_near_float32(golden_dit):
    half = replace(TINY.dit, dtype="bfloat16")
    velocity = apply(half, golden_dit, *inputs(golden_dit))
    assert velocity.dtype == jnp.float32
    # 8 bits of mantissa, 2^-8 = 4e-3 a rounding, through 6 blocks of some ten roundings each.
    assert gap(velocity, apply(TINY.dit, golden_dit, *inputs(golden_dit))) < 0.05


def test_the_islands_keep_float32_parameters_in_a_bfloat16_network():
    shapes = dit_shapes(replace(TINY.dit, param_dtype="bfloat16"))
    wide = {
        path[-2].key if path[-1].key in ("kernel", "bias", "scale") else path[-1].key
        for path, leaf in jax.tree_util.tree_leaves_with_path(shapes)
        if leaf.dtype == jnp.float32
    }
    islands = {"time_in", "time_out", "time_modulation", "modulation", "text_norm", "query_norm", "key_norm"}
    assert wide == islands


def test_the_published_size_has_its_number_of_parameters():
    config = WanConfig().dit
    assert count(dit_shapes(config)) == 2_153_972_032
    assert count(dit_shapes(replace(config, control_every=0))) == 1_418_996_800


def test_the_published_size_lowers_for_gpu_and_tpu_with_abstract_weights():
    """The paper's 41 frames of 448 x 896: 12 x 56 x 112 latents. A scan over depth keeps the program small."""
    config = replace(WanConfig().dit, param_dtype="bfloat16")
    shape = jax.ShapeDtypeStruct
    latents, control = (shape((1, 12, 56, 112, channels), jnp.float32) for channels in (16, 96))
    arguments = (latents, shape((1,), jnp.float32), shape((1, 512, 4096), jnp.bfloat16), control)
    forward = jax.jit(Dit(config).apply)
    program = jax.export.export(forward, platforms=("cuda", "tpu"))({"params": dit_shapes(config)}, *arguments)
    assert program.out_avals[0].shape == latents.shape
    assert len(program.mlir_module_serialized) < 200_000  # bytes; 77 kB when written: no table, no unrolled depth


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"depth": 3}, "depth must be a multiple of control_every"),
        ({"dtype": "int8"}, "dtype must be one of .*int8"),
        ({"kernel": "magic"}, "magic"),
        ({"head_dim": 7}, "must be even"),
        ({"patch": (1, 2, 0)}, "patch must be in"),
    ],
)
def test_bad_configs_are_refused_by_name(options, named):
    with pytest.raises(InputError, match=named):
        DitConfig(**options)
