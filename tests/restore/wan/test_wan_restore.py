"""The whole way, from a degraded clip to a clean one, with a tiny network: any length, no seam, a key decides."""

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.restore.background import restore_background
from rein3d_jax.restore.wan.config import TINY
from rein3d_jax.restore.wan.restore import (
    DegradedClip,
    DiffusionConfig,
    SampleConfig,
    WanParams,
    clip_noise,
    restore_frames,
    restore_video,
)
from rein3d_jax.restore.wan.vae import Vae
from rein3d_jax.restore.wan.windows import WindowConfig
from rein3d_jax.scene import Video

SHALLOW = replace(TINY.dit, depth=2, control_every=1, circular=True)
CIRCULAR = replace(TINY, dit=SHALLOW, vae=replace(TINY.vae, circular=True))
CONFIG = DiffusionConfig(CIRCULAR, SampleConfig(steps=2, guidance=2.0, windows=WindowConfig(5, 1)))
FRAMES, HEIGHT, WIDTH = 6, 16, 32
KEYS = jax.random.split(jax.random.key(0), 3)
RGB = jax.random.uniform(KEYS[0], (FRAMES, HEIGHT, WIDTH, 3))
ALPHA = jax.random.uniform(KEYS[1], (FRAMES, HEIGHT, WIDTH)).at[0].set(1.0)
NOISE = clip_noise(KEYS[2], ALPHA.shape, CONFIG)
TOKEN = 16  # pixels


@pytest.fixture(scope="module")
def params(shallow_dit, golden_dit, golden_vae):
    return WanParams(shallow_dit, golden_vae["params"], golden_dit["text"][0], golden_dit["text"][1])


def frames(params, key, *parts, noise=NOISE):
    return restore_frames(jax.random.key(key), params, DegradedClip(*parts), noise, CONFIG)


@pytest.mark.parametrize("key", [1, 2])
def test_a_yaw_by_whole_tokens_commutes(params, key):
    """restore(roll(x)) = roll(restore(x)), under the same yaws between the steps or others: no column is special."""
    straight = frames(params, 1, RGB, ALPHA, RGB[0])
    parts = (jnp.roll(x, TOKEN, axis) for x, axis in ((RGB, 2), (ALPHA, 2), (RGB[0], 1)))
    rolled = frames(params, key, *parts, noise=jnp.roll(NOISE, TOKEN // 8, axis=2))
    # float32 through 4 network passes a clip and a VAE whose norms over 4 channels magnify; 4e-5 when written.
    np.testing.assert_allclose(rolled, jnp.roll(straight, TOKEN, axis=2), atol=5e-4)
    inside = np.mean((straight > 0) & (straight < 1))
    assert straight.shape == RGB.shape and inside > 0.9  # or cutting would hide errors


def test_what_is_decoded_are_the_frames_and_not_the_anchor(params):
    """A network that sees no reason to move leaves the noise, and the decoder gets it from its second latent on."""
    still = params.replace(dit=params.dit | {"head": jax.tree.map(jnp.zeros_like, params.dit["head"])})
    drawn = frames(still, 1, RGB, ALPHA, RGB[0])
    decode = jax.jit(lambda latents: Vae(CIRCULAR.vae).apply({"params": params.vae}, latents, method="decode"))
    # The first window's own frames; float32 coefficients of the solver, magnified as above.
    np.testing.assert_allclose(drawn[:4], (decode(NOISE[None, 1:3])[0, :4] + 1) / 2, atol=5e-3)


def test_the_anchor_has_noise_of_its_own(params):
    """The first latent; that of a window's first frame, once more, would be correlated with it."""
    one, other = (frames(params, 1, RGB, ALPHA, RGB[0], noise=NOISE.at[0].add(shift)) for shift in (0.0, 1.0))
    assert np.abs(one - other).max() > 1e-3


def test_it_is_a_restorer(params):
    """Observed pixels return to the bit, holes get a colour of the key's and the background's distance."""
    distance = jnp.where(ALPHA < 0.5, 0.0, 1 + RGB[..., 0])
    video = Video(RGB, ALPHA, distance, jnp.tile(jnp.eye(4), (FRAMES, 1, 1)))
    restorer = partial(restore_video, params=params, config=CONFIG, observed=0.5)
    one, same, other = (restorer(video, jax.random.key(seed)) for seed in (1, 1, 2))
    seen, hole = ALPHA >= 0.9, ALPHA < 0.5
    np.testing.assert_array_equal(one.rgb[seen], RGB[seen])
    np.testing.assert_array_equal(one.rgb, same.rgb)
    assert np.isfinite(one.rgb).all() and one.rgb.min() >= 0 and one.rgb.max() <= 1
    assert np.abs(one.rgb - other.rgb)[hole].mean() > 0.01
    np.testing.assert_array_equal(one.alpha, ALPHA)
    np.testing.assert_array_equal(one.distance, restore_background(video, observed=0.5).distance)
    assert one.distance.min() > 0.5


def test_bad_sizes_and_names_are_refused(params):
    low = Video(RGB[:, :8], ALPHA[:, :8], ALPHA[:, :8], jnp.tile(jnp.eye(4), (FRAMES, 1, 1)))
    with pytest.raises(InputError, match="multiples of 16"):
        restore_video(low, KEYS[0], params=params, config=CONFIG, observed=0.5)
    with pytest.raises(InputError, match='solver must be one of unipc, euler, not "leapfrog"'):
        SampleConfig(solver="leapfrog")
    with pytest.raises(InputError, match="noise must be one of latitude"):
        SampleConfig(noise="pink")
    with pytest.raises(InputError, match="steps"):
        SampleConfig(steps=0)
