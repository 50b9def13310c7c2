"""Laws of overlap and colour: solid where it is plain, sharp where it is not."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.geometry.poses import equirectangular_camera, rigid
from rein3d_jax.geometry.resample import pad_sphere
from rein3d_jax.geometry.sphere import pixel_rays, world_from_camera_axes
from rein3d_jax.lift import LiftConfig, lift_adaptively
from rein3d_jax.lift.appearance import sharpened, splat_overlap
from rein3d_jax.rasterize import render
from rein3d_jax.scene import Panorama

HEIGHT = 64
SHAPE = (HEIGHT, 2 * HEIGHT)
AXES = world_from_camera_axes()


def noise(seed=0):
    return jax.random.uniform(jax.random.key(seed), (*SHAPE, 3), minval=0.3, maxval=0.7)


def test_plain_pictures_overlap_and_detailed_ones_do_not():
    plain = splat_overlap(jnp.full((*SHAPE, 3), 0.4), detailed=0.75, plain=1.2)
    np.testing.assert_allclose(plain, 1.2, rtol=1e-6)  # exp(0), but for float32 sums of nine
    np.testing.assert_allclose(splat_overlap(noise(), detailed=0.75, plain=1.2), 0.75, rtol=1e-3)


def test_a_gradient_is_plain():
    slope = jnp.sin(jnp.arange(SHAPE[1]) * 2 * jnp.pi / SHAPE[1])[:, None] * jnp.full((*SHAPE, 3), 0.3) + 0.5
    # A wave of 128 pixels bends by 0.3 (2 pi / 128)^2 / 3 = 2.4e-4 from a plane: a ten-thousandth of what is detail.
    # Not beside the poles, across which such a wave is a step.
    wide = splat_overlap(slope, detailed=0.75, plain=1.2)[4:-4]
    np.testing.assert_allclose(wide, 1.2, rtol=1e-3)


def test_sharpening_nothing_or_by_nothing_changes_nothing():
    np.testing.assert_allclose(sharpened(noise(), 0.0), noise(), atol=1e-7)
    np.testing.assert_allclose(sharpened(jnp.full((*SHAPE, 3), 0.4), 1.25), 0.4, atol=1e-6)


def test_sharpening_commutes_with_yaw():
    rolled = sharpened(jnp.roll(noise(), 17, axis=1), 1.25)
    np.testing.assert_allclose(rolled, jnp.roll(sharpened(noise(), 1.25), 17, axis=1), atol=1e-6)


def test_blurring_brings_the_picture_back():
    """A picture of some pixels' waves, blurred by [1 2 1] / 4 both ways: a quarter of the error is left at most."""

    def blurred(x):
        padded = pad_sphere(x, 1)
        rows = (padded[:-2] + 2 * padded[1:-1] + padded[2:]) / 4
        return (rows[:, :-2] + 2 * rows[:, 1:-1] + rows[:, 2:]) / 4

    smooth = blurred(blurred(noise()))
    before, after = (jnp.mean((blurred(x) - smooth) ** 2) for x in (smooth, sharpened(smooth, 1.0)))
    assert after < before / 4


def box(height):
    """A room of one colour, 4.8 x 3.9 x 2.7 m, seen from a place off its middle."""
    ray = np.asarray(pixel_rays(height, 2 * height))
    far = np.where(ray > 0, [2.6, 2.1, 1.1], [2.2, 1.8, 1.6])
    distance = (far / np.maximum(np.abs(ray), 1e-9)).min(-1).astype(np.float32)
    every = jnp.ones(distance.shape, bool)
    return Panorama(jnp.full((*distance.shape, 3), 0.6), jnp.asarray(distance), every)


@pytest.mark.slow
@pytest.mark.parametrize("share", [1.0, 0.5, 0.25])
def test_a_wall_is_solid_and_plain_wherever_it_is_seen_from(share):
    room = box(128)
    origin = rigid(AXES, jnp.zeros(3))
    scene = lift_adaptively(room, origin, room.valid, config=LiftConfig(share=share))
    for place in ((0.8, 0.3, 0.0), (1.5, 0.8, 0.0)):
        frame, _ = render(scene, equirectangular_camera(rigid(AXES, jnp.array(place)), 128))
        alpha, shade = np.asarray(frame.alpha), 255 * np.asarray(frame.rgb[..., 1])
        # The bars of benchmarks.surfaces (1st percentile 0.98 there), at half its size: creases are twice as wide.
        assert alpha.mean() >= 0.995 and np.percentile(alpha, 1) >= 0.97
        assert np.percentile(np.abs(np.diff(shade, axis=1)), 99) <= 1.0
