"""Flicker is the noise that was added to a still video; motion of the camera counts as well."""

import numpy as np

from rein3d_jax.evaluate.flicker import flicker

NOISE = 0.05


def frames_of(box_room, step):
    """Three frames of a camera that goes `step` (3,) metres a frame."""
    rays = box_room.rays(64, 128)
    origins = [t * np.array(step) for t in range(3)]
    points = [origin + rays * box_room.distance(origin, rays)[..., None] for origin in origins]
    return np.stack([box_room.colour(each) for each in points]).astype(np.float32)


def test_flicker_is_the_noise_of_a_still_video(box_room):
    still = frames_of(box_room, (0.0, 0.0, 0.0))
    assert flicker(still) == 0
    noisy = still + np.random.default_rng(0).normal(0, NOISE, still.shape).astype(np.float32)
    # sampling: 2 differences of 64 x 128 x 3 pixels, so 1 / sqrt(2 * 49152) = 0.3 %
    np.testing.assert_allclose(flicker(noisy), NOISE, rtol=0.02)


def test_motion_counts(box_room):
    near, far = (frames_of(box_room, (step, 0.03, 0.0)) for step in (0.1, 0.2))
    assert 0.03 < flicker(near) < flicker(far)
