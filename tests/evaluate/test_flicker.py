"""Flicker is the noise that was added, and undoing the camera's motion leaves only that."""

import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.evaluate.flicker import flicker, still_flicker
from rein3d_jax.geometry.poses import upright

FRAMES, HEIGHT, WIDTH = 4, 64, 128
NOISE = 0.05
STILL, AHEAD, ASIDE = (0.0, 0.0, 0.0), (0.1, 0.03, 0.0), (-0.2, 0.5, 0.0)  # metres a frame


def walk(box_room, step, turn=0.0):
    """Frames, true distances and poses of a camera that goes `step` (3,) metres and turns `turn` radians a frame."""
    rays, frames, distances, poses = box_room.rays(HEIGHT, WIDTH), [], [], []
    for t in range(FRAMES):
        c, s = np.cos(turn * t), np.sin(turn * t)
        turned = rays @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T
        origin = t * np.array(step)
        distances.append(box_room.distance(origin, turned))
        frames.append(box_room.colour(origin + turned * distances[-1][..., None]))
        poses.append(upright(origin, yaw=turn * t))
    return np.asarray(frames, np.float32), np.asarray(distances, np.float32), jnp.stack(poses)


def noisy(frames):
    return frames + np.random.default_rng(0).normal(0, NOISE, frames.shape).astype(np.float32)


def test_nothing_happens_in_a_still_video(box_room):
    frames, distance, still = walk(box_room, STILL)
    assert flicker(frames) == 0
    assert still_flicker(frames, distance, still) < 1e-5  # bilinear weights at pixel centres, in float32


def test_flicker_is_the_noise_of_a_still_video(box_room):
    frames, distance, still = walk(box_room, STILL)
    for value in (flicker(noisy(frames)), still_flicker(noisy(frames), distance, still)):
        # sampling: 3 differences of 64 x 128 x 3 pixels, so 1 / sqrt(2 * 73728) = 0.3 %; the sphere's weights add some
        np.testing.assert_allclose(value, NOISE, rtol=0.02)


@pytest.mark.parametrize(("step", "turn"), [(AHEAD, 0.0), (STILL, 0.3), (AHEAD, -0.2)])
def test_motion_is_undone(box_room, step, turn):
    frames, distance, moving = walk(box_room, step, turn)
    # Bilinear interpolation of waves up to 3.5 rad a metre, pixels up to 0.2 m: 0.4 (0.7)^2 / 8 = 0.025 at worst, where
    # the wall is far; nearer it falls with the square.
    assert still_flicker(frames, distance, moving) < 0.005
    assert flicker(frames) > 0.03
    # The frame that is sampled between its pixels keeps 4/9 of its noise's variance: sqrt((1 + 4/9) / 2) = 0.85.
    undone = still_flicker(noisy(frames), distance, moving)
    assert 0.8 * NOISE < undone < 1.05 * NOISE  # along an axis less is lost, and interpolation's error comes on top


def test_only_what_two_frames_see_is_compared(box_room):
    """What the box hid from the frame before may look any way."""
    frames, distance, moving = (values[:2] for values in walk(box_room, ASIDE))
    points = np.array(moving[1, :3, 3], np.float64) + box_room.rays(HEIGHT, WIDTH) * distance[1][..., None]
    painted = frames.copy()
    painted[1][box_room.hidden(points)] = 1.0  # frame 0 stands at the origin
    assert flicker(painted) ** 2 - flicker(frames) ** 2 > 0.02**2  # what it would add
    spoilt, clean = (still_flicker(video, distance, moving) for video in (painted, frames))
    np.testing.assert_allclose(spoilt, clean, atol=0.002)  # pixels along the shadow's outline
    assert jnp.isnan(still_flicker(frames, np.zeros_like(distance), moving))
