"""A box is found again from the distances it gives; a ball is told from a box."""

import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.depth.shell_from_distance import shell_from_distance
from rein3d_jax.geometry.shell import RoomShell, meet_shell
from rein3d_jax.geometry.sphere import pixel_rays
from rein3d_jax.scene import Panorama

HEIGHT, WIDTH = 32, 64
EVERY = jnp.ones((HEIGHT, WIDTH), bool)
WALLS, FLOOR, CEILING = jnp.array([2.5, 2.0, 1.8, 3.0]), 1.6, 1.1


def box(yaw: float) -> jnp.ndarray:
    shell = RoomShell(jnp.float32(yaw), WALLS, jnp.float32(FLOOR), jnp.float32(CEILING))
    return meet_shell(shell, jnp.zeros(3), pixel_rays(HEIGHT, WIDTH))[0]


def panorama(distance, valid=EVERY) -> Panorama:
    return Panorama(jnp.zeros((HEIGHT, WIDTH, 3)), distance, valid)


@pytest.mark.parametrize("degrees", [0.0, 17.0, 45.0, 88.4])
def test_a_box_is_recovered(degrees) -> None:
    shell, support = shell_from_distance(panorama(box(np.radians(degrees))))
    off = (np.degrees(float(shell.yaw)) - degrees + 45) % 90 - 45  # a box is its own quarter turn
    assert abs(off) <= 1.0  # the grid of yaws
    turns = round((np.degrees(float(shell.yaw)) - degrees - off) / 90)
    # 2 %: 1 % of the sphere may lie beyond a face, and a wall's last pixel row ends before its edge.
    np.testing.assert_allclose(np.roll(shell.walls, turns), WALLS, rtol=0.02)
    np.testing.assert_allclose([shell.floor, shell.ceiling], [FLOOR, CEILING], rtol=0.02)
    assert support > 0.98


def test_furniture_and_holes_cost_support_and_not_the_box() -> None:
    distance = box(0.3).at[15:22, 5:20].multiply(0.5)
    valid = EVERY.at[:, 30:35].set(False)
    shell, support = shell_from_distance(panorama(distance, valid))
    whole, _ = shell_from_distance(panorama(box(0.3)))
    np.testing.assert_allclose(shell.walls, whole.walls, rtol=0.02)  # as above
    assert 0.7 < support < 0.97


def test_unknown_distances_do_not_matter() -> None:
    """What is not valid may hold any finite number."""
    valid = EVERY.at[:, 30:35].set(False)
    shells = [shell_from_distance(panorama(jnp.where(valid, box(0.3), x), valid)) for x in (0.0, 1e4)]
    np.testing.assert_array_equal(shells[0][0].walls, shells[1][0].walls)
    assert shells[0][1] == shells[1][1]


def test_a_ball_is_no_box() -> None:
    _, support = shell_from_distance(panorama(jnp.full((HEIGHT, WIDTH), 3.0)))
    # On the box around a ball only the caps within 5 % lie: 6 x (1 - 0.95) / 2 = 15 % of the sphere, and the
    # quantiles pull the faces in by 2 %, which adds as much again.
    assert support < 0.45
