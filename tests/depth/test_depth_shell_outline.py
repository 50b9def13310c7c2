"""Laws of a room's lines and parts as they are seen from inside."""

import jax.numpy as jnp
import numpy as np

from rein3d_jax.depth.room_shell import shell_distance
from rein3d_jax.depth.shell_outline import shell_edges, shell_parts
from rein3d_jax.geometry.shell import RoomShell
from rein3d_jax.geometry.sphere import pixel_rays, pixels_from_rays

H, W = 32, 64
ROUNDING = 1e-5  # float32 through one rotation and one division


def box(yaw=0.4, walls=(2.0, 3.1, 1.2, 2.4), floor=1.6, ceiling=1.1):
    return RoomShell(jnp.float32(yaw), jnp.array(walls, jnp.float32), jnp.float32(floor), jnp.float32(ceiling))


def in_box_axes(points, yaw):
    """Independent of the code under test: complex multiplication by e^(-i yaw)."""
    turned = (points[..., 0] + 1j * points[..., 1]) * np.exp(-1j * yaw)
    return turned.real, turned.imag, points[..., 2]


def test_the_end_of_every_ray_lies_on_the_box():
    shell = box()
    points = np.asarray(pixel_rays(H, W) * shell_distance(shell, H, W)[..., None], np.float64)
    x, y, z = in_box_axes(points, 0.4)
    slack = np.stack([2.0 - x, 3.1 - y, x + 1.2, y + 2.4, z + 1.6, 1.1 - z])
    # Inside of every plane, and on the nearest.
    np.testing.assert_allclose(slack.min(axis=0), 0, atol=ROUNDING)


def test_a_march_along_rays_leaves_the_box_at_its_distance():
    distance = np.asarray(shell_distance(box(), H, W))
    steps = np.linspace(0.0, 5.0, 2001)
    rays = np.asarray(pixel_rays(H, W))[::7, ::5]
    x, y, z = in_box_axes(rays[..., None, :] * steps[:, None], 0.4)
    inside = (x < 2.0) & (y < 3.1) & (x > -1.2) & (y > -2.4) & (z > -1.6) & (z < 1.1)
    np.testing.assert_allclose(steps[inside.sum(axis=-1) - 1], distance[::7, ::5], atol=2 * steps[1])  # a step


def test_a_box_turned_left_by_columns_rolls_left():
    columns = 5
    turned = shell_distance(box(yaw=0.4 + columns * 2 * np.pi / W), H, W)
    expected = jnp.roll(shell_distance(box(), H, W), -columns, axis=1)
    np.testing.assert_allclose(turned, expected, atol=ROUNDING)


def test_a_quarter_turn_of_the_box_renames_its_walls():
    walls = (2.0, 3.1, 1.2, 2.4)
    renamed = box(yaw=0.4 - np.pi / 2, walls=np.roll(walls, 1))
    np.testing.assert_allclose(shell_distance(renamed, H, W), shell_distance(box(), H, W), atol=ROUNDING)


def test_edges_are_seen_at_their_own_distance():
    starts, ends = shell_edges(box())
    middles = (starts + ends) / 2
    distance = shell_distance(box(), 512, 1024)
    u, v = pixels_from_rays(middles, 512, 1024)
    seen = distance[v.astype(int), u.astype(int)]
    # A pixel's centre is up to half a pixel off the edge: 0.003 radians at a grazing angle of 30 degrees or more.
    np.testing.assert_allclose(seen, jnp.linalg.norm(middles, axis=-1), rtol=0.01)


def test_parts_are_shares_and_follow_the_nearest_plane():
    parts = shell_parts(box(), H, W)
    np.testing.assert_allclose(parts.sum(axis=-1), 1, atol=ROUNDING)
    assert parts[0].argmax(axis=-1).tolist() == [1] * W  # the zenith is ceiling
    assert parts[-1].argmax(axis=-1).tolist() == [2] * W  # the nadir is floor
    assert parts[H // 2].argmax(axis=-1).tolist() == [0] * W  # the horizon is wall
