"""A box room of one colour a face, with a board in it and a window."""

import jax.numpy as jnp
import pytest

from rein3d_jax.geometry.shell import RoomShell, meet_shell
from rein3d_jax.geometry.sphere import pixel_rays
from rein3d_jax.scene import Panorama

ROWS = 32
SHELL = RoomShell(jnp.float32(0.2), jnp.array([2.0, 1.6, 2.4, 1.9]), jnp.float32(1.3), jnp.float32(1.1))


def box(rows: int = ROWS) -> tuple[Panorama, object]:
    """The empty room, and the face of each pixel."""
    distance, face = meet_shell(SHELL, jnp.zeros(3), pixel_rays(rows, 2 * rows))
    colours = jnp.linspace(0.2, 0.8, 6)[:, None] * jnp.ones(3)
    return Panorama(colours[face], distance, jnp.ones(distance.shape, bool)), face


@pytest.fixture
def empty() -> Panorama:
    return box()[0]


@pytest.fixture
def furnished(empty) -> Panorama:
    """With a black board at half the way to the walls, rows 14 to 19, columns 20 to 27."""
    board = jnp.zeros(empty.valid.shape, bool).at[14:20, 20:28].set(True)
    rgb = jnp.where(board[..., None], 0.0, empty.rgb)
    return Panorama(rgb, jnp.where(board, empty.distance / 2, empty.distance), empty.valid)


@pytest.fixture
def with_window(empty) -> Panorama:
    """With a white window, rows 12 to 17, columns 40 to 47, far away as the completion places it."""
    window = jnp.zeros(empty.valid.shape, bool).at[12:18, 40:48].set(True)
    rgb = jnp.where(window[..., None], 1.0, empty.rgb)
    return Panorama(rgb, jnp.where(window, 20.0, empty.distance), ~window)
