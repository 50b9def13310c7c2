"""The count of operations is the published one and XLA's own; settings cost what theory says."""

import json
from dataclasses import replace
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import pytest

from rein3d_jax.restore.wan.config import TINY, DitConfig, VaeConfig, WanConfig
from rein3d_jax.restore.wan.cost import ClipCost, clip_cost, pass_flops, program_flops, seconds_by_device, vae_flops
from rein3d_jax.restore.wan.dit import Dit
from rein3d_jax.restore.wan.restore import DiffusionConfig, SampleConfig
from rein3d_jax.restore.wan.training.memory import dit_shapes, vae_shapes
from rein3d_jax.restore.wan.vae import Vae
from rein3d_jax.restore.wan.windows import WindowConfig

ROOT = Path(__file__).resolve().parents[3]
# One step of the scan over depth, since XLA counts a loop's body once; wide, so that products dwarf elementwise work.
SHALLOW = DitConfig(4, 64, 1024, depth=1, control_every=1, text_dim=64, frequencies=32, dtype="float32", kernel="xla")
LATENTS, TEXT = (2, 8, 16), 128
VAE = VaeConfig(base=48, multipliers=(1, 2), blocks=1, halve_time=(True,))


def shape(*sides):
    return jax.ShapeDtypeStruct(sides, jnp.float32)


def cost(frames=17, **sample):
    return clip_cost(DiffusionConfig(TINY, SampleConfig(**{"guidance": 1.0, "steps": 4} | sample)), frames, 64, 128)


def test_the_papers_clip_costs_what_the_port_was_measured_at():
    assert pass_flops(WanConfig().dit, (12, 56, 112), 512) == pytest.approx(172.7e12, rel=1e-3)  # its last digit


def test_a_compiled_pass_has_as_many_operations_in_xlas_account():
    given = shape(1, *LATENTS, 16), shape(1), shape(1, TEXT, 64), shape(1, *LATENTS, 96)
    compiled = jax.jit(Dit(SHALLOW).apply).lower({"params": dit_shapes(SHALLOW)}, *given).compile()
    # Elementwise work is 1 to 2 % at this width.
    assert 1 <= compiled.cost_analysis()["flops"] / pass_flops(SHALLOW, LATENTS, TEXT) < 1.03


@pytest.mark.parametrize(("decode", "given"), [(False, (1, 9, 32, 64, 3)), (True, (1, 5, 16, 32, 16))])
def test_the_vae_has_as_many_operations_in_xlas_account(decode, given):
    """Of the program as lowered: once compiled, products with the padding's zeros are left out (10 to 30 %)."""
    method = partial(Vae(VAE).apply, method="decode" if decode else "encode")
    lowered = jax.jit(method).lower({"params": vae_shapes(VAE)}, shape(*given))
    counted = program_flops(method, {"params": vae_shapes(VAE)}, shape(*given))
    assert 1 <= lowered.cost_analysis()["flops"] / counted < 1.01  # elementwise work


def test_loops_count_as_often_as_they_run():
    two, four, six = (pass_flops(replace(TINY.dit, depth=depth), LATENTS, TEXT) for depth in (2, 4, 6))
    assert four - two == six - four > 0
    chunked = replace(SHALLOW, kernel="chunked", query_chunk=64)
    given = shape(1, *LATENTS, 16), shape(1), shape(1, TEXT, 64), shape(1, *LATENTS, 96)
    counted = program_flops(Dit(chunked).apply, {"params": dit_shapes(chunked)}, *given)
    assert counted == pass_flops(SHALLOW, LATENTS, TEXT)  # 64 divides the 256 / 4 tokens: nothing is padded


def test_steps_and_guidance_multiply_the_passes_and_words_cost_little():
    few, many, guided, wordless = cost(), cost(steps=8), cost(guidance=3.0), cost(words=False)
    assert (few.passes, many.passes, guided.passes) == (4, 8, 8)
    assert many.transformer == guided.transformer == 2 * few.transformer and many.vae == few.vae
    assert 0 < wordless.transformer < few.transformer and few.total == few.transformer + few.vae


def test_windows_are_paid_one_by_one():
    whole, windowed = cost(windows=WindowConfig(17, 1)), cost(windows=WindowConfig(9, 1))
    assert windowed.passes == 2 * whole.passes  # frames 0 to 8, and 8 to 16
    alone = cost(9, windows=WindowConfig(9, 1))
    assert (windowed.transformer, windowed.vae) == (2 * alone.transformer, 2 * alone.vae)


def test_seconds_grow_with_operations_and_are_those_that_an_h100_took():
    one, two = (seconds_by_device(ClipCost(1, n * 1e15, n * 1e14)) for n in (1, 2))
    assert all(two[name] == pytest.approx(2 * one[name]) for name in one)
    assert one["H100"] < one["A100"] < one["CPU core"]
    measured = json.loads((ROOT / "benchmarks/results/gpu.json").read_text("utf-8"))["rehearsal"]
    took = {name: part["seconds"] for name, part in measured["parts"].items()}
    sample = SampleConfig(steps=measured["steps"])  # under guidance
    foreseen = seconds_by_device(clip_cost(DiffusionConfig(WanConfig(), sample), *measured["clip"]))["H100"]
    assert foreseen == pytest.approx(took["encode"] + took["denoise"] + took["decode"], rel=0.05)


def test_a_clip_encodes_two_streams_and_an_anchor_and_is_decoded_once():
    parts = [
        vae_flops(TINY.vae, frames, 64, 128, decode=decode) for frames, decode in ((17, False), (1, False), (17, True))
    ]
    assert cost().vae == 2 * parts[0] + parts[1] + parts[2]
