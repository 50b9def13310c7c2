"""Parameters to folders and back, both layouts, whole and in shards; every tensor accounted for by name."""

import json
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from safetensors.numpy import load_file, save_file

from rein3d_jax.errors import InputError
from rein3d_jax.io.weights.safetensors_folder import load_params, save_params, tensor_names
from rein3d_jax.restore.wan.config import TINY, WanConfig
from rein3d_jax.restore.wan.names import LAYOUTS, dit_rows, layout_of, vae_rows
from rein3d_jax.restore.wan.training.memory import count, dit_shapes, vae_shapes

FILE = "diffusion_pytorch_model.safetensors"
PARTS = {"dit": (dit_rows, dit_shapes(TINY.dit), TINY.dit), "vae": (vae_rows, vae_shapes(TINY.vae), TINY.vae)}


def drawn(shapes):
    leaves, structure = jax.tree.flatten(shapes)
    draw = np.random.default_rng(0)
    return jax.tree.unflatten(structure, [draw.normal(size=leaf.shape).astype(np.float32) for leaf in leaves])


@pytest.fixture
def saved(tmp_path):
    """A folder with the tiny VAE, its rows and shapes."""
    shapes = vae_shapes(TINY.vae)
    rows = vae_rows(shapes, TINY.vae, "wan")
    save_params(tmp_path, rows, drawn(shapes))
    return tmp_path, rows, shapes


def refusal(folder, rows, shapes):
    with pytest.raises(InputError) as caught:
        load_params(folder, rows, shapes)
    assert "\n" not in str(caught.value) and str(folder) in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize("shard", [2**30, 20_000])
def test_parameters_come_back_to_the_bit(tmp_path, part, layout, shard):
    rows_of, shapes, config = PARTS[part]
    rows, params = rows_of(shapes, config, layout), drawn(shapes)
    save_params(tmp_path, rows, params, shard=shard)
    assert (len(list(tmp_path.glob("*.safetensors"))) > 1) == (shard < 2**30)
    assert layout_of(tensor_names(tmp_path)) == layout
    for before, after in zip(
        jax.tree.leaves(params), jax.tree.leaves(load_params(tmp_path, rows, shapes)), strict=True
    ):
        np.testing.assert_array_equal(before, after)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_table_of_the_published_size_is_one_to_one_and_loses_no_number(layout):
    config = WanConfig()
    for rows, shapes in (
        (dit_rows(dit_shapes(config.dit), config.dit, layout), dit_shapes(config.dit)),
        (vae_rows(vae_shapes(config.vae), config.vae, layout), vae_shapes(config.vae)),
    ):
        assert len({row.name for row in rows}) == len(rows) == len({(row.leaf, row.index) for row in rows})
        assert sum(int(np.prod(row.shape)) for row in rows) == count(shapes)


@pytest.mark.parametrize(
    ("layout", "name", "shape"),
    [
        ("diffusers", "vace_patch_embedding.weight", (1536, 96, 1, 2, 2)),
        ("diffusers", "blocks.29.attn2.to_out.0.weight", (1536, 1536)),
        ("diffusers", "vace_blocks.14.ffn.net.0.proj.weight", (8960, 1536)),
        ("diffusers", "blocks.7.norm2.bias", (1536,)),
        ("diffusers", "scale_shift_table", (1, 2, 1536)),
        ("wan", "blocks.7.norm3.bias", (1536,)),
        ("wan", "vace_blocks.0.before_proj.weight", (1536, 1536)),
        ("wan", "vace_blocks.3.after_proj.bias", (1536,)),
        ("wan", "time_projection.1.weight", (9216, 1536)),
    ],
)
def test_names_and_shapes_of_the_published_transformer(layout, name, shape):
    config = WanConfig().dit
    assert {row.name: row.shape for row in dit_rows(dit_shapes(config), config, layout)}[name] == shape


def test_types_are_cast_to_those_asked_for(tmp_path):
    config = replace(TINY.dit, param_dtype="bfloat16")
    shapes = dit_shapes(config)
    rows, params = dit_rows(shapes, config, "diffusers"), drawn(shapes)
    save_params(tmp_path, rows, jax.tree.map(lambda leaf: leaf.astype(jnp.bfloat16), params))
    loaded = load_params(tmp_path, rows, shapes)
    assert loaded["embed"]["kernel"].dtype == jnp.bfloat16 and loaded["modulation"].dtype == jnp.float32
    np.testing.assert_array_equal(loaded["head"]["kernel"], params["head"]["kernel"].astype(jnp.bfloat16))


def test_missing_unknown_and_misshapen_tensors_are_named(saved):
    folder, rows, shapes = saved
    tensors = load_file(folder / FILE)
    tensors["extra.weight"] = tensors.pop("encoder.conv1.bias")
    tensors["conv2.bias"] = np.zeros((3, 5), np.float32)
    tensors["decoder.head.0.gamma"] = np.zeros(tensors["decoder.head.0.gamma"].shape, np.int64)
    save_file(tensors, folder / FILE)
    message = refusal(folder, rows, shapes)
    for part in (
        "lacks encoder.conv1.bias (4,)",
        "has extra.weight, which is unknown",
        "has conv2.bias (3, 5), not (16,)",
        "has decoder.head.0.gamma as I64",
    ):
        assert part in message


def test_many_faults_are_counted(saved):
    folder, rows, shapes = saved
    save_file({"other": np.zeros(1, np.float32)}, folder / FILE)
    assert f"and {len(rows) + 1 - 10} more" in refusal(folder, rows, shapes)


def test_damaged_and_missing_files_are_named(saved):
    folder, rows, shapes = saved
    data = (folder / FILE).read_bytes()
    for damage in (data[: len(data) // 2], b"", b"no weights at all"):
        (folder / FILE).write_bytes(damage)
        assert "damaged" in refusal(folder, rows, shapes)
    (folder / FILE).unlink()
    assert "no .safetensors file" in refusal(folder, rows, shapes)
    assert "no folder" in refusal(folder / "nowhere", rows, shapes)


@pytest.mark.parametrize(
    ("index", "named"),
    [
        ([], "weight_map"),
        ({"weight_map": {"a": 1}}, "weight_map"),
        ({"weight_map": {"a": "../../etc/passwd"}}, "outside"),
        ({"weight_map": {"a": "gone.safetensors"}}, "cannot be read"),
    ],
)
def test_a_bad_index_is_named(saved, index, named):
    folder, rows, shapes = saved
    (folder / "model.safetensors.index.json").write_text(json.dumps(index))
    assert named in refusal(folder, rows, shapes)


def test_a_checkpoint_of_something_else_is_refused():
    with pytest.raises(InputError, match="neither"):
        layout_of(["unet.weight"])
