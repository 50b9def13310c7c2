"""Laws of the room's shell: rays meet the nearest of six planes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.geometry.rotations import matrix_from_quats, yaw_quat
from rein3d_jax.geometry.shell import FACES, RoomShell, meet_shell, world_from_shell

WALLS, FLOOR, CEILING = np.array([3.0, 2.0, 1.5, 4.0]), 1.6, 1.1
ORIGIN = np.array([0.4, -0.7, 0.2])
meet = jax.jit(meet_shell)


def shell_at(yaw: float) -> RoomShell:
    return RoomShell(jnp.float32(yaw), jnp.float32(WALLS), jnp.float32(FLOOR), jnp.float32(CEILING))


def directions(seed: int = 0) -> np.ndarray:
    rays = np.random.default_rng(seed).normal(size=(500, 3))
    rays[:6] = [[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]
    return (rays / np.linalg.norm(rays, axis=-1, keepdims=True)).astype(np.float32)


def outward(yaw: float) -> np.ndarray:
    """(6, 3) normals of the faces, in the world: turned LEFT by yaw, then a quarter turn left each."""
    at = yaw + np.arange(4) * np.pi / 2
    return np.concatenate([np.stack([np.cos(at), np.sin(at), 0 * at], -1), [[0, 0, 1], [0, 0, -1]]])


@pytest.mark.parametrize("yaw", [0.0, 0.4, 2.5])
def test_points_lie_on_the_named_face_and_inside_the_others(yaw) -> None:
    rays = directions()
    distance, face = meet(shell_at(yaw), jnp.float32(ORIGIN), rays)
    points = ORIGIN + np.asarray(distance, np.float64)[:, None] * rays
    beyond = points @ outward(yaw).T - np.array([*WALLS, CEILING, FLOOR])
    assert set(np.unique(face)) == set(range(FACES))
    assert np.all(beyond < 2e-6)  # float32 at up to 5 m
    np.testing.assert_allclose(beyond[np.arange(len(rays)), face], 0, atol=2e-6)


def test_brute_force_by_marching() -> None:
    """The first step outside, on a ray cut into millimetres."""
    rays, reach = directions(1)[:40], np.arange(0, 7, 1e-3)
    inside = (ORIGIN + reach[:, None, None] * rays) @ outward(0.4).T <= np.array([*WALLS, CEILING, FLOOR])
    marched = reach[np.argmin(inside.all(axis=-1), axis=0)]
    distance, _ = meet(shell_at(0.4), jnp.float32(ORIGIN), rays)
    np.testing.assert_allclose(distance, marched, atol=1.1e-3)  # one step


def test_a_turned_room_meets_turned_rays_alike() -> None:
    turn = matrix_from_quats(yaw_quat(0.9))
    rays = directions(2)
    before = meet(shell_at(0.4), jnp.float32(ORIGIN), rays)
    after = meet(shell_at(1.3), jnp.matmul(turn, jnp.float32(ORIGIN)), jnp.matmul(rays, turn.T))
    # float32 directions are off by 1e-7, relative to a slant of at least 1e-3 here
    np.testing.assert_allclose(after[0], before[0], rtol=1e-4)
    assert np.mean(np.asarray(after[1]) != np.asarray(before[1])) < 0.01  # a ray into an edge may pick either face


def test_a_point_outside_a_face_is_at_distance_zero_from_it() -> None:
    distance, face = meet(shell_at(0.0), jnp.array([3.5, 0.0, 0.0]), jnp.array([[1.0, 0.0, 0.0]]))
    assert float(distance[0]) == 0 and int(face[0]) == 0


def test_the_shell_frame_is_turned_left() -> None:
    np.testing.assert_allclose(world_from_shell(shell_at(0.4))[:, 0], outward(0.4)[0], atol=1e-6)  # float32
