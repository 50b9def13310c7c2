"""diffusers as an independent oracle, in float64 torch, for the transformer, the VAE, UniPC, conditioning and names.

pip install diffusers torch && python -m pytest -m bench tests/restore/wan/test_wan_parity.py
python tests/restore/wan/test_wan_parity.py   # writes golden/*.npz, which the everyday tests read
"""

import ast
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from safetensors.numpy import save_file

from rein3d_jax.io.weights.safetensors_folder import load_params
from rein3d_jax.restore.wan.condition import control_latents
from rein3d_jax.restore.wan.config import TINY, VaeConfig, WanConfig
from rein3d_jax.restore.wan.dit import Dit
from rein3d_jax.restore.wan.names import dit_rows, vae_rows
from rein3d_jax.restore.wan.sampler import sample_latents
from rein3d_jax.restore.wan.schedule import sampling_sigmas
from rein3d_jax.restore.wan.solver import unipc
from rein3d_jax.restore.wan.training.memory import dit_shapes, vae_shapes
from rein3d_jax.restore.wan.vae import MEAN, STD, Vae

pytestmark = pytest.mark.bench


class Library:
    """A module imported at its first use: collecting tests should not take torch's ten seconds."""

    def __init__(self, name: str):
        self.name = name

    def __getattr__(self, attribute):
        if attribute.startswith("__") and attribute != "__file__":  # pytest asks each name it collects for marks
            raise AttributeError(attribute)
        return getattr(pytest.importorskip(self.name), attribute)


torch, diffusers = Library("torch"), Library("diffusers")
single_file_utils = Library("diffusers.loaders.single_file_utils")

GOLDEN = Path(__file__).parent / "golden"
DIT_TOLERANCE = 1e-4  # of the largest value: float32 through 6 blocks, a timestep of 999 radians among the inputs
VAE_TOLERANCE = 1e-5  # float64, but float32 at both doors; float32 alone is 6e-5 off where a norm has 2 channels
SOLVER_TOLERANCE = 1e-6  # float64 with sigmas rounded to float32, in another order of operations
FRAMES = (1, 5, 9, 13)
VAES = {"tiny": TINY.vae, "all stages differ": VaeConfig(base=8)}


def channels_first(x):
    """(b, t, h, w, c) array -> (b, c, t, h, w) float64 tensor."""
    return torch.tensor(x).double().permute(0, 4, 1, 2, 3)


def channels_last(x):
    return x.permute(0, 2, 3, 4, 1).numpy()


def redraw(module, seed):
    """Weights far from their defaults, which hide errors; as float32, so that both sides compute with the same."""
    generator = torch.Generator().manual_seed(seed)
    for name, weight in module.named_parameters():
        draw = torch.randn(weight.shape, generator=generator, dtype=torch.float32)
        spread = 0.15 if weight.ndim < 2 else weight[0].numel() ** -0.5
        weight.data = (draw * spread + ("gamma" in name or "norm_" in name)).double()
    return module.eval().requires_grad_(False)


def weights_of(module):
    return {name: value.numpy().astype(np.float32) for name, value in module.state_dict().items()}


def dit_oracle():
    config = TINY.dit
    return redraw(
        diffusers.WanVACETransformer3DModel(
            num_attention_heads=config.heads,
            attention_head_dim=config.head_dim,
            text_dim=config.text_dim,
            ffn_dim=config.ffn,
            num_layers=config.depth,
            vace_layers=list(range(0, config.depth, config.control_every)),
            vace_in_channels=config.control_channels,
            freq_dim=config.frequencies,
        ),
        0,
    )


def vae_oracle(config):
    sizes = {"base_dim": config.base, "dim_mult": list(config.multipliers), "num_res_blocks": config.blocks}
    return redraw(diffusers.AutoencoderKLWan(z_dim=16, temperal_downsample=list(config.halve_time), **sizes), 1)


def dit_case():
    """Inputs, weights and what diffusers makes of them."""
    config, draw, model = TINY.dit, np.random.default_rng(0), dit_oracle()
    latents, control = (draw.normal(size=(2, 3, 4, 6, c)).astype(np.float32) for c in (16, config.control_channels))
    text, timestep = draw.normal(size=(2, 7, config.text_dim)).astype(np.float32), np.array([999.0, 37.0], np.float32)
    scale = np.array([1.0, 0.5], np.float32)
    velocity = model(
        channels_first(latents),
        torch.tensor(timestep.astype(np.int64)),
        torch.tensor(text).double(),
        control_hidden_states=channels_first(control),
        control_hidden_states_scale=torch.tensor(scale).double(),
        return_dict=False,
    )[0]
    case = {"latents": latents, "control": control, "text": text, "timestep": timestep, "scale": scale}
    return case | {"velocity": channels_last(velocity)} | weights_of(model)


def vae_case(config, frames):
    model, draw = vae_oracle(config), np.random.default_rng(frames)
    video = draw.uniform(-1, 1, size=(1, frames, 16, 32, 3)).astype(np.float32)
    mode = model.encode(channels_first(video)).latent_dist.mode()
    latents = (channels_last(mode) - MEAN) / STD
    return {"video": video, "latents": latents, "decoded": channels_last(model.decode(mode).sample)} | weights_of(model)


def unipc_case(steps):
    """diffusers' scheduler over a velocity that anyone can write down."""
    scheduler = diffusers.UniPCMultistepScheduler(
        prediction_type="flow_prediction", use_flow_sigmas=True, flow_shift=3.0, num_train_timesteps=1000
    )
    scheduler.set_timesteps(steps)
    noise = np.random.default_rng(steps).normal(size=(2, 4, 6, 3)).astype(np.float32)
    x = torch.tensor(noise).double()
    for timestep in scheduler.timesteps:
        x = scheduler.step(torch.sin(2 * x) + timestep / 1000 * x, timestep, x, return_dict=False)[0]
    return {"noise": noise, "sample": x.numpy(), "timesteps": scheduler.timesteps.numpy()}


def vace_pipeline():
    """The pipeline's own preparation, cut out of its file: importing that would need the text encoder's library."""
    tree = ast.parse((Path(diffusers.__file__).parent / "pipelines/wan/pipeline_wan_vace.py").read_text("utf-8"))
    wanted = {"retrieve_latents", "prepare_video_latents", "prepare_masks"}
    found = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef) and node.name in wanted]
    for node in found:
        node.returns = None
        for argument in node.args.args:
            argument.annotation = None
    functions = {"torch": torch}
    exec(compile(ast.Module(found, []), "pipeline_wan_vace.py", "exec"), functions)
    return SimpleNamespace(**{name: functions[name] for name in wanted})


def condition_case():
    """The pipeline's own preparation with a VAE that can be told apart channel by channel."""
    reference, draw = vace_pipeline(), np.random.default_rng(5)
    video, anchor = draw.uniform(0, 1, (1, 41, 32, 48, 3)), draw.uniform(0, 1, (1, 32, 48, 3))
    alpha = draw.choice([0.2, 0.49, 0.5, 0.51, 1.0], (1, 41, 32, 48))
    case = {"rgb": video, "alpha": alpha, "anchor": anchor}
    case = {name: value.astype(np.float32) for name, value in case.items()}
    config = SimpleNamespace(latents_mean=[0.0] * 16, latents_std=[1.0] * 16, z_dim=16)
    pipeline = SimpleNamespace(
        vae=SimpleNamespace(
            dtype=torch.float32, config=config, encode=lambda x: SimpleNamespace(latents=torch_encode(x))
        ),
        transformer=SimpleNamespace(config=SimpleNamespace(patch_size=(1, 2, 2))),
        vae_scale_factor_spatial=8,
        vae_scale_factor_temporal=4,
    )
    video, mask = torch.tensor(2 * case["rgb"] - 1), torch.tensor(1 - case["alpha"])
    video, mask = video.permute(0, 4, 1, 2, 3), mask[:, None].expand(-1, 3, -1, -1, -1)
    first = [[torch.tensor(2 * case["anchor"][0] - 1).permute(2, 0, 1)]]
    latents = reference.prepare_video_latents(pipeline, video, mask, first, device="cpu")
    masks = reference.prepare_masks(pipeline, torch.where(mask > 0.5, 1.0, 0.0), first)
    return case | {"control": channels_last(torch.cat([latents, masks], dim=1))}


def torch_encode(video):
    """(b, 3, t, h, w) -> (b, 16, t', h / 8, w / 8): every fourth frame and eighth pixel, times 1 to 5 and a bit."""
    thin = video[:, :, ::4, ::8, ::8]
    return torch.cat([thin * (1 + k) for k in range(5)] + [thin[:, :1] * 0.5], dim=1)


def encode(video):
    """`torch_encode` on channels-last arrays."""
    thin = video[:, ::4, ::8, ::8]
    return jnp.concatenate([thin * (1 + k) for k in range(5)] + [thin[..., :1] * 0.5], axis=-1)


def golden_cases():
    return {"dit": dit_case(), "vae": vae_case(TINY.vae, 9), "unipc": unipc_case(10)}


def params_from(folder, case, rows, shapes):
    names = {row.name for row in rows}
    save_file({name: value for name, value in case.items() if name in names}, folder / "weights.safetensors")
    return load_params(folder, rows, shapes)


def test_transformer(tmp_path):
    case, shapes = dit_case(), dit_shapes(TINY.dit)
    params = params_from(tmp_path, case, dit_rows(shapes, TINY.dit, "diffusers"), shapes)
    inputs = [jnp.asarray(case[name]) for name in ("latents", "timestep", "text", "control", "scale")]
    velocity = jax.jit(Dit(TINY.dit).apply)({"params": params}, *inputs)
    assert np.abs(velocity - case["velocity"]).max() < DIT_TOLERANCE * np.abs(case["velocity"]).max()


@pytest.mark.parametrize("frames", FRAMES)
@pytest.mark.parametrize("name", VAES)
def test_vae(tmp_path, name, frames):
    case, shapes = vae_case(VAES[name], frames), vae_shapes(VAES[name])
    params = {"params": params_from(tmp_path, case, vae_rows(shapes, VAES[name], "diffusers"), shapes)}
    vae = Vae(replace(VAES[name], dtype="float64"))
    with jax.enable_x64(True):
        latents = jax.jit(lambda x: vae.apply(params, x, method="encode"))(case["video"])
        decoded = jax.jit(lambda x: vae.apply(params, x, method="decode"))(case["latents"])
    np.testing.assert_allclose(latents, case["latents"], rtol=0, atol=VAE_TOLERANCE)
    np.testing.assert_allclose(decoded, case["decoded"], rtol=0, atol=VAE_TOLERANCE)
    assert (np.abs(case["decoded"]) < 1).mean() > 0.3  # or clipping would hide what the decoder does


@pytest.mark.parametrize("steps", [1, 2, 4, 10, 50])
def test_unipc(steps):
    case, solver = unipc_case(steps), unipc(sampling_sigmas(steps, 3.0))
    np.testing.assert_array_equal(solver.timestep, case["timesteps"])
    with jax.enable_x64(True):
        noise = jnp.asarray(case["noise"], jnp.float64)
        drawn = sample_latents(jax.random.key(0), lambda x, _, t: jnp.sin(2 * x) + t / 1000 * x, noise, None, solver)
    np.testing.assert_allclose(drawn, case["sample"], rtol=0, atol=SOLVER_TOLERANCE)


def test_conditioning():
    case = condition_case()
    control = control_latents(encode, case["rgb"], case["alpha"], case["anchor"], stride=8)
    np.testing.assert_array_equal(control, case["control"])


def test_the_original_names_are_those_that_diffusers_converts():
    shapes = dit_shapes(TINY.dit)
    ours = {row.name: np.float32(0) for row in dit_rows(shapes, TINY.dit, "wan")}
    pairs = zip(ours, (row.name for row in dit_rows(shapes, TINY.dit, "diffusers")), strict=True)
    for original, converted in pairs:
        assert set(single_file_utils.convert_wan_transformer_to_diffusers({original: np.zeros(6)})) == {converted}
    config = WanConfig().vae
    rows = [vae_rows(vae_shapes(config), config, layout) for layout in ("wan", "diffusers")]
    for original, converted in zip(*rows, strict=True):
        assert set(single_file_utils.convert_wan_vae_to_diffusers({original.name: 0})) == {converted.name}


def test_the_published_size_has_the_tensors_of_the_reference():
    config = WanConfig()
    with torch.device("meta"):
        dit = diffusers.WanVACETransformer3DModel(
            num_attention_heads=12, num_layers=30, ffn_dim=8960, vace_layers=list(range(0, 30, 2))
        )
        vae = diffusers.AutoencoderKLWan()
    for model, rows in (
        (dit, dit_rows(dit_shapes(config.dit), config.dit, "diffusers")),
        (vae, vae_rows(vae_shapes(config.vae), config.vae, "diffusers")),
    ):
        assert {row.name: row.shape for row in rows} == {n: tuple(x.shape) for n, x in model.state_dict().items()}


@pytest.mark.parametrize("name", ["dit", "vae", "unipc"])
def test_golden_files_hold_what_diffusers_says(name):
    case = golden_cases()[name]
    with np.load(GOLDEN / f"{name}.npz") as golden:
        assert set(golden) == set(case)
        for key, value in case.items():  # torch's sums differ from machine to machine in their last bits
            np.testing.assert_allclose(golden[key], value, rtol=1e-6, atol=1e-6)


if __name__ == "__main__":
    for name, case in golden_cases().items():
        np.savez_compressed(GOLDEN / f"{name}.npz", **{k: np.asarray(v).astype(np.float32) for k, v in case.items()})
