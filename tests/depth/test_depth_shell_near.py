"""A painted box is found near one of another size, and furniture does not mislead."""

import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.depth.room_shell import RoomShellConfig, shell_distance
from rein3d_jax.depth.shell_evidence import box_of, shell_of
from rein3d_jax.depth.shell_near import fit_shell_near
from rein3d_jax.geometry.shell import RoomShell, meet_shell
from rein3d_jax.geometry.sphere import pixel_rays

H, W = 128, 256
TRUE = RoomShell(jnp.float32(0.3), jnp.array([1.5, 2.1, 1.9, 1.2]), jnp.float32(1.0), jnp.float32(0.75))
COLOURS = jnp.array(
    [[0.8, 0.7, 0.6], [0.5, 0.6, 0.5], [0.6, 0.5, 0.7], [0.7, 0.7, 0.5], [0.9, 0.9, 0.9], [0.4, 0.3, 0.2]]
)


def painted():
    """The room in six flat colours."""
    _, face = meet_shell(TRUE, jnp.zeros(3), pixel_rays(H, W))
    return COLOURS[face]


def test_a_box_and_its_numbers_are_inverse():
    again = shell_of(box_of(TRUE), 1.0)
    for name in ("yaw", "walls", "floor", "ceiling"):
        np.testing.assert_allclose(getattr(again, name), getattr(TRUE, name), rtol=1e-5)


@pytest.mark.slow  # a fit compiles for some seconds
@pytest.mark.parametrize("size", [0.87, 1.12])
def test_the_size_is_the_pictures(size):
    guess = TRUE.replace(walls=size * TRUE.walls, ceiling=size * TRUE.ceiling)
    hidden = (jnp.arange(H) > H // 2)[:, None] & (jnp.abs(jnp.arange(W) - W // 3) < W // 10)
    rgb = jnp.where(hidden[..., None], jnp.array([0.9, 0.1, 0.1]), painted())
    seen = 1.0 - hidden
    found = fit_shell_near(rgb, shell_distance(guess, H, W), seen, config=RoomShellConfig())
    # a third of a pixel (0.5 degrees) on a floor line 2 camera heights away is 4 %
    np.testing.assert_allclose(found.walls, TRUE.walls, rtol=0.04)
    np.testing.assert_allclose(found.ceiling, TRUE.ceiling, rtol=0.04)
    np.testing.assert_allclose(found.yaw, TRUE.yaw, atol=np.deg2rad(1.0))
