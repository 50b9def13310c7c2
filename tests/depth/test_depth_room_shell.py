"""A painted box is found again from its picture."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.depth.room_shell import RoomShellConfig, fit_room_shell, shell_distance
from rein3d_jax.errors import InputError
from rein3d_jax.geometry.shell import RoomShell
from rein3d_jax.geometry.sphere import pixel_rays

pytestmark = pytest.mark.slow  # whole fits

H, W = 256, 512  # the fit's working size: nothing is lost to resampling
# A painted box is easy to find: a quarter of the default search does.
CONFIG = RoomShellConfig(climbers=256, rounds=12, children=8, finalists=4)

BOXES = {
    "centred": RoomShell(jnp.float32(0.0), jnp.array([2.5, 2.0, 2.5, 2.0]), jnp.float32(1.6), jnp.float32(1.0)),
    "off centre": RoomShell(jnp.float32(0.55), jnp.array([1.4, 3.2, 2.9, 1.7]), jnp.float32(1.6), jnp.float32(1.2)),
    "long": RoomShell(jnp.float32(-0.3), jnp.array([4.5, 1.3, 2.0, 1.8]), jnp.float32(1.6), jnp.float32(0.8)),
}
COLOURS = jnp.array(
    [[0.8, 0.7, 0.6], [0.5, 0.6, 0.5], [0.6, 0.5, 0.7], [0.7, 0.7, 0.5], [0.9, 0.9, 0.9], [0.4, 0.3, 0.2]]
)


def painted(shell):
    """Six flat colours and a little noise. Which plane a ray ends on is found from where it ends."""
    points = pixel_rays(H, W) * shell_distance(shell, H, W)[..., None]
    cos, sin = jnp.cos(shell.yaw), jnp.sin(shell.yaw)
    x, y, z = points[..., 0] * cos + points[..., 1] * sin, points[..., 1] * cos - points[..., 0] * sin, points[..., 2]
    front, left, back, right = shell.walls
    slack = jnp.stack([front - x, left - y, x + back, y + right, shell.ceiling - z, z + shell.floor])
    noise = 0.02 * jax.random.normal(jax.random.key(0), (H, W, 3))
    return jnp.clip(COLOURS[jnp.argmin(slack, axis=0)] + noise, 0, 1)


@pytest.mark.parametrize("name", BOXES)
def test_a_painted_box_is_found_again(name):
    truth = BOXES[name]
    shell, info = fit_room_shell(painted(truth), config=CONFIG)
    # Half a pixel (0.35 degrees) on a floor line 4.5 m away is 6 cm; on one 2 m away 2 cm.
    np.testing.assert_allclose(shell.walls, truth.walls, rtol=0.02, atol=0.02)
    np.testing.assert_allclose(shell.ceiling, truth.ceiling, rtol=0.02)
    np.testing.assert_allclose(shell.yaw, truth.yaw, atol=np.deg2rad(0.5))
    assert info["support"] > 0.5


def test_a_camera_twice_as_high_sees_a_room_twice_as_large():
    picture = painted(BOXES["off centre"])
    shell, info = fit_room_shell(picture, config=CONFIG)
    tall, tall_info = fit_room_shell(picture, 3.2, config=CONFIG)
    assert info == tall_info
    assert float(tall.yaw) == float(shell.yaw)
    # Bit for bit: the camera's height enters after the fit, and doubling is exact.
    np.testing.assert_array_equal(
        [*tall.walls, tall.floor, tall.ceiling], 2 * np.array([*shell.walls, shell.floor, shell.ceiling])
    )


def test_a_picture_without_edges_is_refused():
    with pytest.raises(InputError, match="distance map"):
        fit_room_shell(jnp.full((64, 128, 3), 0.5), config=CONFIG)


@pytest.mark.parametrize(
    "bad",
    [
        {"wall_range": (0.0, 5.0)},
        {"wall_range": (5.0, 0.6)},
        {"max_aspect": 0.5},
        {"edge_weights": (0.0, 0.0, 0.0)},
        {"noise": 0.0},
        {"climbers": 0},
    ],
)
def test_settings_that_no_room_fits_are_refused_by_name(bad):
    with pytest.raises(InputError, match=f"^{next(iter(bad))} must"):
        RoomShellConfig(**bad)
