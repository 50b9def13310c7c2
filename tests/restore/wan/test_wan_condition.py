"""VACE's control: streams that add up to the video, masks folded without loss, the anchor first and all of it given."""

import jax
import jax.numpy as jnp
import numpy as np

from rein3d_jax.restore.wan.condition import control_latents, fold_mask, mask_of, signal_of, streams

FRAMES, HEIGHT, WIDTH = 9, 16, 24
KEYS = jax.random.split(jax.random.key(0), 3)
RGB = jax.random.uniform(KEYS[0], (2, FRAMES, HEIGHT, WIDTH, 3))
ALPHA = jax.random.uniform(KEYS[1], (2, FRAMES, HEIGHT, WIDTH)).at[:, 3].set(0.0)
ANCHOR = jax.random.uniform(KEYS[2], (2, HEIGHT, WIDTH, 3))


def encode(video):
    """Every fourth frame, every eighth pixel, six times over: 16 channels that say where they come from."""
    return jnp.tile(video[:, ::4, ::8, ::8], 6)[..., :16]


def control(rgb=RGB, alpha=ALPHA, anchor=ANCHOR):
    return control_latents(encode, rgb, alpha, anchor, stride=8)


def test_streams_share_out_the_video_by_the_mask():
    signal, mask = signal_of(RGB, ALPHA), mask_of(ALPHA)
    inactive, reactive = streams(signal, mask)
    np.testing.assert_array_equal(inactive + reactive, signal)
    np.testing.assert_array_equal((inactive != 0).any(axis=-1) & (reactive != 0).any(axis=-1), False)
    np.testing.assert_array_equal(mask_of(jnp.array([0.0, 0.49, 0.5, 1.0])), [1, 1, 0, 0])


def test_what_nobody_saw_is_mid_grey_and_not_black():
    assert (signal_of(RGB, ALPHA)[:, 3] == 0).all()
    np.testing.assert_array_equal(signal_of(RGB, jnp.ones_like(ALPHA)), 2 * RGB - 1)


def test_the_order_is_anchor_then_video_and_inactive_reactive_mask():
    latents = control()
    assert latents.shape == (2, 1 + 3, 2, 3, 96)
    inactive, reactive = streams(signal_of(RGB, ALPHA), mask_of(ALPHA))
    np.testing.assert_array_equal(latents[:, 1:, ..., :16], encode(inactive))
    np.testing.assert_array_equal(latents[:, 1:, ..., 16:32], encode(reactive))
    np.testing.assert_array_equal(latents[:, 0, ..., :16], encode(2 * ANCHOR[:, None] - 1)[:, 0])
    assert (latents[:, 0, ..., 16:] == 0).all()


def test_folding_a_mask_loses_no_pixel_of_the_frames_it_takes():
    """41 frames go to 11, each to the nearest centre: 1, 5, 9, 13, 16, 20, ... 39."""
    mask = jax.random.bernoulli(KEYS[0], shape=(1, 41, 16, 24)).astype(jnp.float32)
    folded = fold_mask(mask, 8, 11)
    unfolded = folded.reshape(1, 11, 2, 3, 8, 8).transpose(0, 1, 2, 4, 3, 5).reshape(1, 11, 16, 24)
    np.testing.assert_array_equal(unfolded, mask[:, [1, 5, 9, 13, 16, 20, 24, 27, 31, 35, 39]])
    np.testing.assert_array_equal(fold_mask(mask, 8, 41).sum(axis=(2, 3, 4)), mask.sum(axis=(2, 3)))


def test_a_yaw_by_whole_latents_commutes():
    moved = control(*(jnp.roll(x, 8, axis=axis) for x, axis in ((RGB, 3), (ALPHA, 3), (ANCHOR, 2))))
    np.testing.assert_array_equal(moved, jnp.roll(control(), 1, axis=3))


def test_a_fully_seen_clip_asks_for_nothing_and_an_unseen_one_for_all():
    seen, unseen = control(alpha=jnp.ones_like(ALPHA)), control(alpha=jnp.zeros_like(ALPHA))
    assert (seen[..., 16:] == 0).all() and (unseen[:, 1:, ..., 32:] == 1).all() and (unseen[:, 1:, ..., :32] == 0).all()
