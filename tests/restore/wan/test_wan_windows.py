"""Windows over long trajectories: a partition of unity that drops no frame and shares its noise."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.restore.wan.windows import (
    WindowConfig,
    latent_length,
    padded_length,
    restore_in_windows,
    window_starts,
    window_weights,
)

SMALL = WindowConfig(frames=9, overlap=5)
LENGTHS = [*range(1, 15), 41, 42, 100]


def clip(frames):
    keys = jax.random.split(jax.random.key(frames), 3)
    rgb, alpha = jax.random.uniform(keys[0], (frames, 2, 4, 3)), jax.random.uniform(keys[1], (frames, 2, 4))
    return rgb, alpha, jax.random.normal(keys[2], (latent_length(frames), 1, 1, 2))


@pytest.mark.parametrize("config", [SMALL, WindowConfig(), WindowConfig(frames=9, overlap=0)])
@pytest.mark.parametrize("frames", LENGTHS)
def test_shares_sum_to_one_and_every_window_is_whole(frames, config):
    length = padded_length(frames)
    assert length % 4 == 1 and frames <= length < frames + 4
    starts, weights = window_starts(length, config), window_weights(length, config)
    np.testing.assert_allclose(weights.sum(axis=0), 1, rtol=1e-12)
    assert all(start % 4 == 0 for start in starts) and starts[-1] + min(config.frames, length) == length
    assert (weights >= 0).all() and len(set(starts)) == len(starts)
    overlaps = np.array(starts[:-1]) + config.frames - np.array(starts[1:])
    assert (overlaps >= config.overlap).all()


@pytest.mark.parametrize("frames", [1, 4, 9, 10, 23])
def test_a_restorer_that_changes_nothing_changes_nothing_at_any_length(frames):
    rgb, alpha, noise = clip(frames)
    restored = restore_in_windows(lambda rgb, alpha, noise: rgb, rgb, alpha, noise, SMALL)
    np.testing.assert_allclose(restored, rgb, atol=1e-6)  # float32 shares that sum to 1


def test_each_window_sees_the_noise_of_its_own_frames():
    """Latent k of a window that begins at frame 4 j is latent j + k of the clip; lengthened frames repeat the last."""
    rgb, alpha, _ = clip(22)
    noise, seen = jnp.arange(7.0).reshape(7, 1, 1, 1), []

    def watch(part_rgb, part_alpha, part_noise):
        assert part_rgb.shape[0] == part_alpha.shape[0] == 9 and latent_length(9) == len(part_noise)
        seen.append((int(part_noise[0, 0, 0, 0]), np.asarray(part_rgb)))
        return part_rgb

    restore_in_windows(watch, rgb, alpha, noise, SMALL)
    long = np.concatenate([rgb, np.repeat(rgb[-1:], 3, axis=0)])
    assert [first for first, _ in seen] == [0, 1, 2, 3, 4]
    for first, part in seen:
        np.testing.assert_array_equal(part, long[4 * first : 4 * first + 9])


def test_neighbours_fade_into_each_other_linearly():
    weights = window_weights(13, SMALL)
    np.testing.assert_allclose(np.diff(weights[1][4:9]), 1 / 6)


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"frames": 40}, "1 \\+ 4 n"),
        ({"frames": 1}, "frames must be in .5, inf"),
        ({"overlap": 38}, "overlap must be in .0, 37"),
        ({"overlap": -1}, "not -1"),
    ],
)
def test_bad_windows_are_refused(options, named):
    with pytest.raises(InputError, match=named):
        WindowConfig(**options)
