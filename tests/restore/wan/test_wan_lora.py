"""LoRAs of others merge to W + scale alpha / r B A under every layout's names; what does not fit is named."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from safetensors.numpy import save_file

from rein3d_jax.errors import InputError
from rein3d_jax.networks.trained import weights_fingerprint
from rein3d_jax.networks.wan import random_wan, read_wan, require_wan, write_wan
from rein3d_jax.restore.restorer import DIFFUSION, RestoreConfig
from rein3d_jax.restore.wan.config import TINY
from rein3d_jax.restore.wan.dit import Dit
from rein3d_jax.restore.wan.lora_names import LoraFileConfig
from rein3d_jax.restore.wan.names import LAYOUTS

RANK, ALPHA, SCALE, WIDTH = 3, 6.0, 0.5, TINY.dit.width
RNG = np.random.default_rng(0)
DOWN, UP = RNG.normal(size=(RANK, WIDTH)).astype(np.float32), RNG.normal(size=(WIDTH, RANK)).astype(np.float32)
BASE = random_wan(0, TINY)
# Main block 3 is block_1 of the scan's step 1 (control_every is 2); its self-attention's query, by six names.
NAMES = {
    "diffusers": ("transformer.blocks.3.attn1.to_q", "lora_A.weight", "lora_B.weight"),
    "peft": ("base_model.model.blocks.3.attn1.to_q", "lora_A.default.weight", "lora_B.default.weight"),
    "wan": ("blocks.3.self_attn.q", "lora_down.weight", "lora_up.weight"),
    "comfy": ("diffusion_model.blocks.3.self_attn.q", "lora_down.weight", "lora_up.weight"),
    "comfy, A and B": ("diffusion_model.blocks.3.self_attn.q", "lora_A.weight", "lora_B.weight"),
    "kohya": ("lora_unet_blocks_3_self_attn_q", "lora_down.weight", "lora_up.weight"),
}


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    made = {layout: tmp_path_factory.mktemp(layout) for layout in LAYOUTS}
    for layout, folder in made.items():
        write_wan(folder, BASE, TINY, layout=layout)
    return made


def merged(folder, tensors, tmp_path, *, scale=SCALE, config=TINY):
    save_file(tensors, tmp_path / "lora.safetensors")
    return read_wan(folder, config, lora=LoraFileConfig(str(tmp_path / "lora.safetensors"), scale)).dit


def query(dit):
    return np.asarray(dit["steps"]["block_1"]["self_attention"]["query"]["kernel"])


def changed_leaves(dit):
    paths = jax.tree_util.tree_leaves_with_path(BASE.dit)
    pairs = zip(paths, jax.tree.leaves(dit), strict=True)
    return [jax.tree_util.keystr(path) for (path, before), after in pairs if not np.array_equal(before, after)]


@pytest.mark.parametrize("base", LAYOUTS)
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("alpha", "shape"), [(None, ()), (ALPHA, ()), (ALPHA, (1,))])
def test_a_pair_adds_its_product_whatever_its_names(folders, tmp_path, base, name, alpha, shape):
    module, down, up = NAMES[name]
    tensors = {f"{module}.{down}": DOWN, f"{module}.{up}": UP}
    tensors |= {} if alpha is None else {f"{module}.alpha": np.full(shape, alpha, np.float32)}
    dit = merged(folders[base], tensors, tmp_path)
    gain = SCALE * (1 if alpha is None else alpha / RANK)
    expected = query(BASE.dit).copy()
    expected[1] += gain * (UP.astype(np.float64) @ DOWN).T  # torch's kernels are (out, in)
    np.testing.assert_allclose(query(dit), expected, rtol=1e-5, atol=1e-6)  # float32 products of 3 numbers
    np.testing.assert_array_equal(query(dit)[0], query(BASE.dit)[0])
    assert changed_leaves(dit) == ["['steps']['block_1']['self_attention']['query']['kernel']"]


def test_the_merged_network_is_the_network_with_the_pair_beside_it(folders, tmp_path):
    """W x + gain B (A x), through the whole transformer: the text's first layer, whose input is ours to choose."""
    folder = folders["wan"]
    down = RNG.normal(size=(RANK, TINY.dit.text_dim)).astype(np.float32)
    pair = {"text_embedding.0.lora_down.weight": down, "text_embedding.0.lora_up.weight": UP}
    dit = merged(folder, pair, tmp_path)
    text = RNG.normal(size=(2, TINY.dit.text_dim)).astype(np.float32)
    layer, adapted = BASE.dit["text_in"], dit["text_in"]
    beside = text @ layer["kernel"] + layer["bias"] + SCALE * (text @ down.T) @ UP.T
    np.testing.assert_allclose(text @ adapted["kernel"] + adapted["bias"], beside, rtol=1e-4, atol=1e-4)  # float32


def test_convolutions_norms_biases_and_controls_are_changed_too(folders, tmp_path):
    shift, conv = np.arange(WIDTH, dtype=np.float32), RNG.normal(size=(RANK, 16, 1, 2, 2)).astype(np.float32)
    tensors = {
        "diffusion_model.blocks.0.norm3.diff": shift,
        "diffusion_model.blocks.0.self_attn.q.diff_b": shift,
        "diffusion_model.patch_embedding.lora_down.weight": conv,
        "diffusion_model.patch_embedding.lora_up.weight": UP.reshape(WIDTH, RANK, 1, 1, 1),
        "diffusion_model.vace_blocks.1.ffn.2.lora_down.weight": RNG.normal(size=(1, 32)).astype(np.float32),
        "diffusion_model.vace_blocks.1.ffn.2.lora_up.weight": np.ones((WIDTH, 1), np.float32),
    }
    dit, first = merged(folders["diffusers"], tensors, tmp_path), BASE.dit["steps"]["block_0"]
    assert len(changed_leaves(dit)) == 4
    block = dit["steps"]["block_0"]
    np.testing.assert_allclose(block["text_norm"]["scale"][0], first["text_norm"]["scale"][0] + SCALE * shift)
    np.testing.assert_allclose(block["self_attention"]["query"]["bias"][0], SCALE * shift)
    kernel = (UP @ conv.reshape(RANK, -1)).T  # 16 x 1 x 2 x 2 channels, the order of a token's
    np.testing.assert_allclose(
        dit["embed"]["kernel"], BASE.dit["embed"]["kernel"] + SCALE * kernel, rtol=1e-5, atol=1e-6
    )


def test_no_scale_is_no_lora_and_twice_the_scale_twice_the_change(folders, tmp_path):
    module, down, up = NAMES["comfy"]
    tensors = {f"{module}.{down}": DOWN, f"{module}.{up}": UP}
    none, one, two = (query(merged(folders["wan"], tensors, tmp_path, scale=scale)) for scale in (0.0, 1.0, 2.0))
    np.testing.assert_array_equal(none, query(BASE.dit))
    np.testing.assert_allclose(two - none, 2 * (one - none), atol=1e-5)  # float32


def test_merging_into_bfloat16_rounds_once(folders, tmp_path):
    """The sum is made in float32, from the file's own numbers."""
    half = replace(TINY, dit=replace(TINY.dit, param_dtype="bfloat16"))
    module, down, up = NAMES["wan"]
    tensors = {f"{module}.{down}": DOWN.astype(jnp.bfloat16), f"{module}.{up}": UP.astype(jnp.bfloat16)}
    rounded = query(merged(folders["wan"], tensors, tmp_path, config=half))
    assert rounded.dtype == jnp.bfloat16
    np.testing.assert_array_equal(rounded, query(merged(folders["wan"], tensors, tmp_path)).astype(jnp.bfloat16))


FAULTS = {
    "unknown": (
        {"blocks.9.self_attn.q.lora_A.weight": DOWN},
        "has blocks.9.self_attn.q.lora_A.weight, which is unknown",
    ),
    "no LoRA": ({"blocks.3.self_attn.q.weight": DOWN}, "has blocks.3.self_attn.q.weight, which is unknown"),
    "half": ({"blocks.3.self_attn.q.lora_A.weight": DOWN}, "has down alone for blocks.3.self_attn.q.weight"),
    "alpha alone": (
        {"blocks.3.self_attn.q.alpha": np.ones(1, np.float32)},
        "has alpha alone for blocks.3.self_attn.q.weight",
    ),
    "ranks": (
        {"blocks.3.self_attn.q.lora_A.weight": DOWN[1:], "blocks.3.self_attn.q.lora_B.weight": UP},
        f"has up ({WIDTH}, 3) and down (2, {WIDTH}) for blocks.3.self_attn.q.weight ({WIDTH}, {WIDTH})",
    ),
    "another network's": (
        {"blocks.3.self_attn.q.lora_A.weight": DOWN[:, 1:], "blocks.3.self_attn.q.lora_B.weight": UP[1:]},
        f"down (3, {WIDTH - 1}) for",
    ),
    "difference": (
        {"blocks.0.norm3.diff": DOWN},
        f"has a difference (3, {WIDTH}) for blocks.0.norm3.weight ({WIDTH},)",
    ),
    "numbers": ({"blocks.0.norm3.diff": np.zeros(WIDTH, np.int32)}, "has blocks.0.norm3.diff as I32"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_what_does_not_fit_is_named_before_anything_is_read(folders, tmp_path, name):
    tensors, message = FAULTS[name]
    file = tmp_path / "lora.safetensors"
    save_file(tensors, file)
    with pytest.raises(InputError) as caught:
        require_wan(folders["wan"], TINY, lora=LoraFileConfig(str(file)))
    said = str(caught.value)
    assert message in said and said.startswith(f"restore.diffusion.lora.file: {file}") and "\n" not in said


def test_a_missing_or_damaged_lora_is_named(folders, tmp_path):
    file = tmp_path / "lora.safetensors"
    for content in (None, b"", b"no weights at all"):
        if content is not None:
            file.write_bytes(content)
        with pytest.raises(InputError, match=r"lora\.safetensors"):
            require_wan(folders["wan"], TINY, lora=LoraFileConfig(str(file)))


def test_a_resumed_job_does_not_mix_two_loras(folders, tmp_path):
    config = RestoreConfig(DIFFUSION, weights=str(folders["wan"]))
    keys = {weights_fingerprint(config)}
    for scale in (1, 2):
        file = tmp_path / f"{scale}.safetensors"
        save_file({"blocks.0.norm3.diff": np.full(WIDTH, scale, np.float32)}, file)
        lora = replace(config.diffusion, lora=LoraFileConfig(str(file)))
        keys.add(weights_fingerprint(replace(config, diffusion=lora)))
    assert len(keys) == 3


def test_without_words_one_token_of_zeros_is_as_good_as_512(folders, golden_dit):
    """Attention to equal tokens is their value, however many there are."""
    folder = folders["diffusers"]
    assert read_wan(folder, TINY, words=False).text.shape == (1, TINY.dit.text_dim)
    latents, control = jnp.asarray(golden_dit["latents"][:1]), jnp.asarray(golden_dit["control"][:1])
    given = {"params": golden_dit["params"]}, latents, jnp.asarray([500.0])
    one, many = (Dit(TINY.dit).apply(*given, jnp.zeros((1, count, TINY.dit.text_dim)), control) for count in (1, 512))
    np.testing.assert_allclose(one, many, rtol=1e-4, atol=1e-4)  # float32: a sum of 512 equal shares


def test_without_words_the_folder_text_is_not_asked_for(folders, tmp_path):
    (tmp_path / "w").mkdir()
    for name in ("transformer", "vae"):
        (tmp_path / "w" / name).symlink_to(folders["wan"] / name)
    require_wan(tmp_path / "w", TINY, words=False)
    with pytest.raises(InputError, match="no folder text"):
        require_wan(tmp_path / "w", TINY)
