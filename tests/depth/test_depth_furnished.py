"""Laws of putting a room together: planes where the witnesses agree, steps where the picture has them."""

import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.depth.furnished import agreed_background, furnished_room
from rein3d_jax.depth.room_shell import shell_distance
from rein3d_jax.geometry.shell import RoomShell
from rein3d_jax.geometry.sphere import azimuths

H, W = 128, 256


def box(size=1.0):
    """A room's distance over the camera's height, its walls and ceiling `size` times as far."""
    shell = RoomShell(
        jnp.float32(0.2), size * jnp.array([1.5, 2.0, 2.5, 1.2]), jnp.float32(1.0), jnp.float32(0.7 * size)
    )
    return shell_distance(shell, H, W)


def grey():
    return jnp.full((H, W, 3), 0.5)


@pytest.mark.parametrize("size", [0.8, 1.0, 1.2])
def test_a_background_of_another_size_becomes_the_shell(size):
    empty, scale, support = agreed_background(box(), box(size))
    assert support > 0.95
    np.testing.assert_allclose(scale, size, rtol=0.02)  # the median is a wall's or the ceiling's: all have one ratio
    # Where one has the floor and the other the wall, the shapes differ.
    close = jnp.abs(empty / box(size) - 1) < 0.01
    assert close.mean() > 0.9


def test_the_floor_is_never_moved():
    empty, _, _ = agreed_background(box(), box(1.3))
    nadir = slice(7 * H // 8, H)
    np.testing.assert_allclose(empty[nadir], box()[nadir], rtol=1e-6)


def test_a_shell_of_another_shape_is_no_witness():
    wavy = box() * jnp.exp(0.5 * jnp.sin(3 * azimuths(W)))
    empty, scale, support = agreed_background(box(), jnp.where(box() == wavy, box(), wavy))
    assert support < 0.7
    assert scale == 1
    np.testing.assert_allclose(empty, box(), rtol=1e-5)


def test_an_empty_room_is_the_shell_itself():
    room = furnished_room(grey(), box(), box(), box())
    assert not room.things.any()
    np.testing.assert_allclose(room.distance, box(), rtol=1e-5)


def test_nothing_stands_between_a_thing_and_the_wall():
    """A thing at half the wall's distance, its rim blurred over some pixels, before a wall of another colour."""
    across, down = 32 - jnp.abs(jnp.arange(W) - W // 2), 20 - jnp.abs(jnp.arange(H) - H // 2)[:, None]
    share = jnp.clip(across / 3 + 0.5, 0, 1) * jnp.clip(down / 3 + 0.5, 0, 1)
    seen = box() * jnp.exp(jnp.log(0.5) * share)
    thing = (share > 0.5)[..., None]
    picture = jnp.where(thing, jnp.array([0.9, 0.2, 0.1]), grey())
    room = furnished_room(picture, seen, box(), box())
    ratio = room.distance / box()
    between = (ratio > 0.6) & (ratio < 0.98)
    assert ((seen / box() > 0.6) & (seen / box() < 0.98)).sum() > 200  # before
    assert between.sum() == 0
    assert (room.things == thing[..., 0]).mean() > 0.98  # its outline is the picture's
    np.testing.assert_allclose(room.distance[H // 2, W // 2], 0.5 * box()[H // 2, W // 2], rtol=0.02)


def test_what_is_seen_through_a_door_stays_beyond():
    door = (jnp.abs(jnp.arange(W) - W // 2) < 20) & (jnp.abs(jnp.arange(H) - H // 2)[:, None] < 28)
    picture = jnp.where(door[..., None], jnp.array([0.1, 0.3, 0.2]), grey())
    room = furnished_room(picture, jnp.where(door, 3 * box(), box()), box(), box())
    np.testing.assert_allclose((room.distance / box())[H // 2, W // 2], 3, rtol=0.02)
    assert (room.things == door).mean() > 0.98
