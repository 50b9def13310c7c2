"""8-bit and 16-bit floats, scaled and plain, in one file or in shards, come out as the numbers they stand for."""

import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from safetensors.numpy import load_file, save_file

from rein3d_jax.errors import InputError
from rein3d_jax.io.weights.safetensors_folder import load_params, save_params
from rein3d_jax.io.weights.tensor_file import FLOAT_8, SCALED_MARK
from rein3d_jax.restore.wan.names import TensorRow

DRAW = np.random.default_rng(0)
KERNEL = DRAW.normal(size=(2, 5, 7)).astype(np.float32)  # two stacked, in x out
BIAS = DRAW.normal(size=7).astype(np.float32)
PARAMS = {"kernel": KERNEL, "bias": BIAS}
LIKE = {name: jax.ShapeDtypeStruct(x.shape, jnp.float32) for name, x in PARAMS.items()}
ROWS = [TensorRow(("kernel",), i, f"blocks.{i}.q.weight", (7, 5), (1, 0)) for i in (0, 1)]
ROWS.append(TensorRow(("bias",), None, "q.bias", (7,), (0,)))
E4M3 = FLOAT_8["F8_E4M3"]


def tensors() -> dict[str, np.ndarray]:
    return {"blocks.0.q.weight": KERNEL[0].T.copy(), "blocks.1.q.weight": KERNEL[1].T.copy(), "q.bias": BIAS}


def scaled(scale) -> dict[str, np.ndarray]:
    """The weights as (weight / scale) in 8 bits; the scales in `scale`'s shape."""
    made = {"q.bias": BIAS.astype(jnp.bfloat16)}
    for name, tensor in tensors().items():
        if name.endswith(".weight"):
            made[name] = (tensor / np.reshape(scale, (-1, 1))).astype(E4M3)
    return made


def read(folder, made: dict[str, np.ndarray]):
    folder.mkdir(exist_ok=True)
    save_file(made, folder / "any_name.safetensors")
    return load_params(folder, ROWS, LIKE)


def refusal(folder, made) -> str:
    with pytest.raises(InputError) as caught:
        read(folder, made)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("kind", [*FLOAT_8.values(), jnp.bfloat16, jnp.float16])
def test_plain_floats_are_their_own_numbers(tmp_path, kind):
    made = read(tmp_path, {name: tensor.astype(kind) for name, tensor in tensors().items()})
    for name, leaf in PARAMS.items():
        np.testing.assert_array_equal(made[name], leaf.astype(kind).astype(np.float32))
    assert made["kernel"].dtype == np.float32


@pytest.mark.parametrize("ending", ["scale_weight", "weight_scale"])
@pytest.mark.parametrize("shape", [(), (1,), (7,), (7, 1)])
def test_scaled_floats_are_multiplied_by_their_scale(tmp_path, ending, shape):
    scale = (0.01 + 0.002 * np.arange(np.prod(shape, dtype=int))).astype(np.float32).reshape(shape)
    made = scaled(scale)
    made |= {f"blocks.{i}.q.{ending}": scale for i in (0, 1)}
    made |= {SCALED_MARK: np.zeros(2, E4M3), "blocks.0.q.scale_input": np.ones(1, np.float32)}
    kernel = read(tmp_path, made)["kernel"]
    exact = np.stack([made[f"blocks.{i}.q.weight"].astype(np.float32).T for i in (0, 1)]) * scale.reshape(-1)
    np.testing.assert_allclose(kernel, exact, rtol=1e-7)  # one product in float32
    np.testing.assert_allclose(kernel, KERNEL, rtol=2**-4, atol=1e-3)  # half of the last of 3 bits; subnormal below


def test_names_of_a_whole_checkpoint_and_shards_are_read(tmp_path):
    made = {f"model.diffusion_model.{name}": tensor for name, tensor in tensors().items()}
    np.testing.assert_array_equal(read(tmp_path / "one", made)["kernel"], KERNEL)
    save_params(tmp_path / "many", ROWS, PARAMS, shard=150)
    index = json.loads(next((tmp_path / "many").glob("*.index.json")).read_text())
    assert len(set(index["weight_map"].values())) == 3
    for file in (tmp_path / "many").glob("*.safetensors"):  # as somebody quantised them
        save_file({name: tensor.astype(E4M3) for name, tensor in load_file(file).items()}, file)
    kernel = load_params(tmp_path / "many", ROWS, LIKE)["kernel"]
    np.testing.assert_array_equal(kernel, KERNEL.astype(E4M3).astype(np.float32))


def test_scales_that_lack_or_do_not_fit_are_named(tmp_path):
    made = scaled(1.0)
    assert "lacks blocks.0.q.scale_weight, though it has scaled_fp8" in refusal(
        tmp_path, made | {SCALED_MARK: np.zeros(0, E4M3)}
    )
    wrong = made | {"blocks.1.q.scale_weight": np.ones((5, 2), np.float32)}
    assert "has blocks.1.q.scale_weight (5, 2), neither one number nor one a row" in refusal(tmp_path, wrong)
    # The scale of a tensor that has all its bits would change it: nobody knows what it is.
    assert "has q.bias.scale_weight, which is unknown" in refusal(
        tmp_path, tensors() | {"q.bias.scale_weight": np.ones(1, np.float32)}
    )


def test_one_tensor_in_two_files_is_refused(tmp_path):
    save_file({"q.bias": BIAS}, tmp_path / "a.safetensors")
    save_file(tensors(), tmp_path / "b.safetensors")
    with pytest.raises(InputError, match=r"a.safetensors and b.safetensors both hold q.bias"):
        load_params(tmp_path, ROWS, LIKE)


def test_a_file_that_ends_early_is_refused(tmp_path):
    read(tmp_path, scaled(1.0))
    file = tmp_path / "any_name.safetensors"
    file.write_bytes(file.read_bytes()[:-3])
    with pytest.raises(InputError, match="damaged"):
        load_params(tmp_path, ROWS, LIKE)
