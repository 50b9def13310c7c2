"""The longest chord: its length in rooms where it is known, its clearance from every point seen, its symmetries."""

import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.explore.chord import longest_chord
from rein3d_jax.explore.profile import ExploreConfig
from rein3d_jax.geometry.shell import RoomShell, meet_shell
from rein3d_jax.geometry.sphere import pixel_rays

CONFIG = ExploreConfig(camera_radius=0.3, stop_buffer=0.1)
HEIGHT = 64


def box_distance(low, high):
    (back, right, floor), (ahead, left, ceiling) = -np.array(low), np.array(high)
    shell = RoomShell(jnp.zeros(()), jnp.array([ahead, left, back, right]), jnp.float32(floor), jnp.float32(ceiling))
    return meet_shell(shell, jnp.zeros(3), pixel_rays(HEIGHT, 2 * HEIGHT))[0]


@pytest.fixture
def corridor():
    """6 m long, 1.2 m wide: only its axis is long."""
    return box_distance([-2.0, -0.6, -1.5], [4.0, 0.6, 1.0])


def chord_of(distance, **options):
    return longest_chord(distance, jnp.ones(distance.shape, bool), config=CONFIG, **options)


def test_runs_from_end_to_end_of_a_corridor(corridor):
    chord = chord_of(corridor)
    # A direction is a column's centre, so the path runs half a column (1.4 degrees) aslant: 5 mm longer at the most.
    assert abs(abs(float(chord.direction[0])) - 1) < 0.01
    assert 6 - 2 * CONFIG.clearance - 0.3 < float(chord.length) <= 6 - 2 * CONFIG.clearance + 5e-3
    end = chord.start + chord.length * chord.direction
    assert float(jnp.minimum(chord.start[0], end[0])) >= -2 + CONFIG.clearance - 5e-3
    assert float(jnp.maximum(chord.start[0], end[0])) <= 4 - CONFIG.clearance + 5e-3


def test_starts_at_the_centre_when_asked(corridor):
    chord = chord_of(corridor, through=False)
    np.testing.assert_array_equal(chord.start, 0)
    assert float(chord.direction[0]) > 0.99  # the far end lies ahead
    assert float(chord.length) <= float(chord_of(corridor).length)


def test_keeps_its_clearance_from_every_point_of_the_band():
    distance = box_distance([-1.5, -2.5, -1.5], [3.0, 1.0, 1.0]).at[:, 20:26].set(1.1)  # a post
    chord = chord_of(distance)
    rows = slice(int(0.45 * HEIGHT), int(0.55 * HEIGHT) + 1)
    points = (pixel_rays(HEIGHT, 2 * HEIGHT) * distance[..., None])[rows].reshape(-1, 3)
    along = jnp.linspace(0, 1, 50)[:, None] * chord.length * chord.direction + chord.start
    gaps = jnp.linalg.norm(points[:, None] - along, axis=-1)
    assert float(gaps.min()) >= CONFIG.clearance - 1e-4  # float32 of metres


def test_turns_with_the_panorama(corridor):
    """A roll by k columns turns the world right by k columns; lengths stay."""
    turned = chord_of(jnp.roll(corridor, 16, axis=1))
    assert float(turned.length) == pytest.approx(float(chord_of(corridor).length), abs=1e-5)
    angle = 16 / (2 * HEIGHT) * 2 * np.pi
    expected = np.array([np.cos(angle), -np.sin(angle)])
    assert abs(abs(float(turned.direction[:2] @ expected)) - 1) < 0.01


def test_nowhere_to_go_is_a_chord_of_no_length():
    chord = chord_of(jnp.full((HEIGHT, 2 * HEIGHT), 0.3))
    assert float(chord.length) == 0 and bool(jnp.isfinite(chord.direction).all())
