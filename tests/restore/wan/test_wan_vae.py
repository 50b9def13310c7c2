"""The VAE: golden parity, the exact yaw symmetry of circular padding, causality in time, extreme inputs, size."""

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.restore.wan.config import TINY, VaeConfig, WanConfig
from rein3d_jax.restore.wan.training.memory import count, vae_shapes
from rein3d_jax.restore.wan.vae import Norm, Vae

# Norms over 2 channels magnify rounding where both are small; in float64 the difference is 1e-7 (test_wan_parity.py).
ROUNDING = 2e-4
CIRCULAR = replace(TINY.vae, circular=True)


@partial(jax.jit, static_argnums=(0, 3))
def run(config, params, x, method):
    return Vae(config).apply({"params": params}, x, method=method)


def test_it_is_what_diffusers_computes(golden_vae):
    params = golden_vae["params"]
    latents = run(TINY.vae, params, golden_vae["video"], "encode")
    decoded = run(TINY.vae, params, golden_vae["latents"], "decode")
    np.testing.assert_allclose(latents, golden_vae["latents"], rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(decoded, golden_vae["decoded"], rtol=0, atol=ROUNDING)


@pytest.mark.parametrize(("config", "symmetric"), [(CIRCULAR, True), (TINY.vae, False)])
def test_a_yaw_by_whole_latents_commutes_with_circular_padding_and_with_no_other(golden_vae, config, symmetric):
    params, video, latents = golden_vae["params"], golden_vae["video"], golden_vae["latents"]
    encoded = run(config, params, np.roll(video, 8, axis=3), "encode")
    decoded = run(config, params, np.roll(latents, 1, axis=3), "decode")
    close = [
        np.abs(encoded - np.roll(run(config, params, video, "encode"), 1, axis=3)).max() < ROUNDING,
        np.abs(decoded - np.roll(run(config, params, latents, "decode"), 8, axis=3)).max() < ROUNDING,
    ]
    assert close == [symmetric, symmetric]


def test_no_frame_sees_a_later_one(golden_vae):
    """One frame alone is coded as that frame of a clip; so an anchor means the same wherever it stands."""
    params = golden_vae["params"]
    first = run(TINY.vae, params, golden_vae["video"][:, :1], "encode")
    np.testing.assert_allclose(first, golden_vae["latents"][:, :1], rtol=0, atol=ROUNDING)
    first = run(TINY.vae, params, golden_vae["latents"][:, :1], "decode")
    np.testing.assert_allclose(first, golden_vae["decoded"][:, :1], rtol=0, atol=ROUNDING)


def test_other_sizes_are_refused_and_not_cut(golden_vae):
    for shape, named in (((1, 4, 16, 32, 3), "1 \\+ 4 n"), ((1, 1, 12, 32, 3), "multiples of 8")):
        with pytest.raises(AssertionError, match=named):
            run(TINY.vae, golden_vae["params"], np.zeros(shape, np.float32), "encode")
    with pytest.raises(InputError, match="halve_time"):
        VaeConfig(multipliers=(1, 2))


@pytest.mark.parametrize("value", [1.0, -1.0, 0.0])
def test_flat_videos_stay_finite(golden_vae, value):
    latents = run(TINY.vae, golden_vae["params"], np.full_like(golden_vae["video"], value), "encode")
    video = run(TINY.vae, golden_vae["params"], np.full_like(golden_vae["latents"], 4 * value), "decode")
    assert np.isfinite(latents).all() and np.isfinite(video).all() and np.abs(video).max() <= 1


def test_the_norm_has_unit_mean_square_and_a_finite_gradient_at_zero():
    x = jax.random.normal(jax.random.key(0), (4, 6))
    norm = Norm()
    params = norm.init(jax.random.key(0), x)
    np.testing.assert_allclose(jnp.square(norm.apply(params, 100 * x)).mean(axis=-1), 1, rtol=1e-5)
    gradient = jax.grad(lambda x: norm.apply(params, x).sum())(jnp.zeros((1, 6)))
    assert np.isfinite(gradient).all()


def test_the_published_size_has_its_number_of_parameters():
    shapes = vae_shapes(WanConfig().vae)
    assert count(shapes) == 126_892_531
    assert (count(shapes["encoder"]), count(shapes["decoder"])) == (53_595_872, 73_295_331)
