"""The forecast: counted parameters, XLA's own account for activations, and refusals that advise."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.restore.wan.config import SMALL, TINY, WanConfig
from rein3d_jax.restore.wan.dit import Dit
from rein3d_jax.restore.wan.training.memory import (
    GIB,
    Workload,
    count,
    dit_shapes,
    forecast,
    require_fit,
    tokens,
    vae_shapes,
)
from rein3d_jax.restore.wan.training.trainable import TrainableConfig
from rein3d_jax.restore.wan.vae import Vae

LARGE = WanConfig()


def test_the_papers_clip_has_the_tokens_it_should():
    assert tokens(LARGE, Workload()) == 12 * 28 * 56 == 18_816


def test_parameters_and_optimizer_are_counted():
    need = forecast(LARGE, Workload(train=True))
    numbers = count(dit_shapes(LARGE.dit)), count(vae_shapes(LARGE.vae))
    assert need.parameters == 4 * sum(numbers)
    assert need.optimizer == 4 * 4 * numbers[0]  # gradient, two moments, the average; 4 bytes each
    assert forecast(LARGE, Workload()).optimizer == 0


def test_training_less_takes_less():
    adapter, lora = (forecast(LARGE, Workload(train=True, trainable=TrainableConfig(p))) for p in ("adapter", "lora"))
    assert adapter.optimizer == 4 * 4 * (2_153_972_032 - 1_418_996_800)
    kernels = 45 * (8 * 1536 * 1536 + 2 * 1536 * 8960)  # of 30 main blocks and 15 of the control's
    pairs = 45 * 32 * (8 * 2 * 1536 + 2 * (1536 + 8960))
    assert lora.optimizer == 4 * 4 * pairs + 2 * 4 * kernels


def test_activations_grow_with_the_batch_and_shrink_with_rematerialisation():
    lean = replace(LARGE, dit=replace(LARGE.dit, remat=True))
    one, two = (forecast(LARGE, Workload(train=True, batch=batch)) for batch in (1, 2))
    assert two.dit_activations == 2 * one.dit_activations and two.vae_activations == 2 * one.vae_activations
    assert forecast(lean, Workload(train=True)).dit_activations < one.dit_activations / 4


@pytest.mark.parametrize(
    ("options", "work", "advice"),
    [
        ({}, Workload(train=True), "dit.remat"),
        ({}, Workload(train=True), "train the adapter alone"),
        ({"remat": True}, Workload(train=True, batch=8), "lower the batch"),
        ({}, Workload(), "vae.dtype"),
        ({"dtype": "float32"}, Workload(frames=401), "bfloat16"),
    ],
)
def test_what_does_not_fit_is_refused_with_advice(options, work, advice):
    config = replace(LARGE, dit=replace(LARGE.dit, **options))
    with pytest.raises(InputError, match=advice):
        require_fit(config, work, 24 * GIB)


def test_what_fits_passes():
    assert require_fit(TINY, Workload(frames=5, height=32, width=64), GIB).total < GIB


@pytest.mark.bench
@pytest.mark.parametrize("train", [False, True])
@pytest.mark.parametrize("remat", [False, True])
@pytest.mark.parametrize("sizes", [{}, {"heads": 4, "head_dim": 32, "ffn": 512, "depth": 6}, {"ffn": 2048, "depth": 4}])
def test_activations_are_what_xla_reserves(train, remat, sizes):
    """Within a factor 2: XLA's CPU backend fuses and reuses otherwise than a GPU's."""
    dit = replace(SMALL.dit, dtype="float32", remat=remat, query_chunk=256, **sizes)
    config, shape = replace(SMALL, dit=dit), jax.ShapeDtypeStruct
    latents, control = (shape((1, 6, 28, 56, channels), jnp.float32) for channels in (16, 96))
    arguments = (latents, shape((1,), jnp.float32), shape((1, 8, dit.text_dim), jnp.float32), control)

    def loss(params, *arguments):
        return jnp.square(Dit(dit).apply({"params": params}, *arguments)).mean()

    compiled = jax.jit(jax.grad(loss) if train else loss).lower(dit_shapes(dit), *arguments).compile()
    need = forecast(config, Workload(frames=17, height=224, width=448, train=train)).dit_activations
    assert 0.5 < compiled.memory_analysis().temp_size_in_bytes / need < 2


@pytest.mark.bench
@pytest.mark.parametrize(("method", "shape"), [("encode", (1, 9, 64, 128, 3)), ("decode", (1, 3, 8, 16, 16))])
def test_the_vae_takes_what_xla_reserves(method, shape):
    config = SMALL.vae
    code = jax.jit(lambda params, x: Vae(config).apply({"params": params}, x, method=method))
    compiled = code.lower(vae_shapes(config), jax.ShapeDtypeStruct(shape, jnp.float32)).compile()
    need = forecast(SMALL, Workload(frames=9, height=64, width=128)).vae_activations
    assert 0.8 < compiled.memory_analysis().temp_size_in_bytes / need < 1.25
