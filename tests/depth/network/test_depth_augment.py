"""Augmentations that are exact: a stretched room is the room that is so long, a rotated one keeps its distances."""

import jax
import jax.numpy as jnp
import numpy as np

from rein3d_jax.depth.network.augment import DepthAugmentConfig, augment_depth, toned
from rein3d_jax.depth.network.augment import warped as eager_warped
from rein3d_jax.depth.network.loss import DepthExample
from rein3d_jax.geometry.rotations import matrix_from_quats, yaw_quat
from rein3d_jax.geometry.shell import RoomShell, meet_shell
from rein3d_jax.geometry.sphere import pixel_rays

ROWS = 64
warped = jax.jit(eager_warped)


@jax.jit
def distance_of(walls):
    shell = RoomShell(jnp.float32(0.0), walls, jnp.float32(1.0), jnp.float32(0.8))
    return meet_shell(shell, jnp.zeros(3), pixel_rays(ROWS, 2 * ROWS))[0]


def box(walls) -> DepthExample:
    distance = distance_of(jnp.array(walls))
    return DepthExample(jnp.repeat(distance[..., None], 3, -1) / 4, distance, distance)


def test_a_stretched_box_is_the_longer_box():
    stretched = warped(box([2.0, 1.5, 3.0, 1.2]), jnp.array([1.2, 0.8, 1.0]), jnp.eye(3))
    expected = box([2.4, 1.2, 3.6, 0.96]).distance
    ratio = np.asarray(stretched.distance / expected)
    assert (
        np.abs(ratio - 1).mean() < 0.01 and np.quantile(np.abs(ratio - 1), 0.99) < 0.06
    )  # the nearest pixel's distance
    np.testing.assert_array_equal(stretched.distance, stretched.background)


def test_a_yaw_by_a_quarter_rolls_the_pixels():
    example = box([2.0, 1.5, 3.0, 1.2])
    rotated = warped(example, jnp.ones(3), matrix_from_quats(yaw_quat(-jnp.pi / 2 - 1e-4)))
    expected = jnp.roll(example.distance, ROWS // 2, axis=1)  # to the right
    assert np.mean(np.abs(np.asarray(rotated.distance - expected)) < 1e-3) > 0.98  # rounding picks a neighbour at seams


def test_what_is_drawn_is_a_picture_and_the_truth_keeps_its_holes():
    example = box([2.0, 1.5, 3.0, 1.2])
    example = example.replace(distance=example.distance.at[30:34].set(0.0))
    still = DepthAugmentConfig(warped=0.0)
    augmented = jax.jit(lambda key, example: augment_depth(key, example, still))
    for seed in range(4):
        changed = augmented(jax.random.key(seed), example)
        assert changed.rgb.min() >= 0 and changed.rgb.max() <= 1
        np.testing.assert_allclose(np.sort(changed.distance, axis=None), np.sort(example.distance, axis=None))
        np.testing.assert_array_equal(changed.distance[30:34], 0.0)


def test_no_strength_leaves_the_picture():
    nothing = DepthAugmentConfig(exposure=0, balance=0, gamma=0, saturation=(1, 1), noise=0, blurred=0)
    rgb = jax.random.uniform(jax.random.key(0), (8, 16, 3), minval=0.01)
    np.testing.assert_allclose(toned(jax.random.key(1), rgb, nothing), rgb, atol=1e-6)
