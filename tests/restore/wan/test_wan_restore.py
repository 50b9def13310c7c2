"""The whole way, from a degraded clip to a clean one, with a tiny network: any length, the same key the same clip."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.restore.wan.config import TINY
from rein3d_jax.restore.wan.restore import SampleConfig, WanParams, restore_video
from rein3d_jax.restore.wan.windows import WindowConfig

CIRCULAR = replace(TINY, dit=replace(TINY.dit, circular=True), vae=replace(TINY.vae, circular=True))
SAMPLING = SampleConfig(steps=2, guidance=2.0, noise="white", turn=True, windows=WindowConfig(5, 1))
FRAMES, HEIGHT, WIDTH = 6, 16, 32


@pytest.fixture
def params(golden_dit, golden_vae):
    return WanParams(golden_dit["params"], golden_vae["params"], golden_dit["text"][0], golden_dit["text"][1])


def clip():
    keys = jax.random.split(jax.random.key(0), 2)
    rgb = jax.random.uniform(keys[0], (FRAMES, HEIGHT, WIDTH, 3))
    return rgb, jax.random.uniform(keys[1], (FRAMES, HEIGHT, WIDTH)), rgb[0]


def test_every_frame_comes_back_finite_and_a_key_decides(params):
    one, same, other = (
        restore_video(jax.random.key(seed), params, *clip(), config=CIRCULAR, sampling=SAMPLING) for seed in (1, 1, 2)
    )
    assert one.shape == (FRAMES, HEIGHT, WIDTH, 3) and np.isfinite(one).all() and one.min() >= 0 and one.max() <= 1
    np.testing.assert_array_equal(one, same)
    assert np.abs(one - other).max() > 0.01


def test_turning_costs_a_circular_network_nothing(params):
    """With circular padding and RoPE the network cannot tell a turned panorama from another."""
    still, turned = (
        restore_video(jax.random.key(1), params, *clip(), config=CIRCULAR, sampling=replace(SAMPLING, turn=turn))
        for turn in (False, True)
    )
    # float32 through 3 network passes a step, magnified by a VAE whose norms have 2 channels.
    np.testing.assert_allclose(still, turned, atol=1e-2)
    np.testing.assert_allclose(jnp.abs(still - turned).mean(), 0, atol=1e-4)


def test_bad_sizes_and_names_are_refused(params):
    rgb, alpha, anchor = clip()
    with pytest.raises(InputError, match="multiples of 16"):
        restore_video(
            jax.random.key(0), params, rgb[:, :8], alpha[:, :8], anchor[:8], config=CIRCULAR, sampling=SAMPLING
        )
    with pytest.raises(InputError, match="leapfrog"):
        SampleConfig(solver="leapfrog")
    with pytest.raises(InputError, match="steps"):
        SampleConfig(steps=0)
