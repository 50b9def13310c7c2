"""Every kind of map comes back to the distance it was made from, and is told from the others."""

import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.depth.kinds import DISTANCE_KINDS, along_ray
from rein3d_jax.depth.plausible import flattest_kind, implausible_size
from rein3d_jax.depth.room_shell import shell_distance
from rein3d_jax.geometry.shell import RoomShell
from rein3d_jax.geometry.sphere import pixel_rays
from rein3d_jax.scene import Panorama

HEIGHT = 64
SHELL = RoomShell(jnp.float32(0.4), jnp.array([2.0, 1.2, 3.0, 0.7]), jnp.float32(1.6), jnp.float32(1.0))
DISTANCE = np.asarray(shell_distance(SHELL, HEIGHT, 2 * HEIGHT))
VALID = np.random.default_rng(0).random(DISTANCE.shape) < 0.995
RAYS = np.asarray(pixel_rays(HEIGHT, 2 * HEIGHT))


def planar_z():
    """Face by face: the distance along the axis of the face that a ray goes through."""
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    along = RAYS @ axes.T
    return DISTANCE * np.take_along_axis(along, np.argmax(along, -1)[..., None], -1)[..., 0]


MAPS = {"distance": DISTANCE, "z": planar_z(), "disparity": 1 / DISTANCE, "relative": DISTANCE}


@pytest.mark.parametrize("kind", DISTANCE_KINDS)
def test_each_kind_gives_the_distance_it_was_made_of(kind):
    found = along_ray(Panorama(None, np.where(VALID, MAPS[kind], 0), VALID), kind)
    np.testing.assert_allclose(np.asarray(found.distance)[VALID], DISTANCE[VALID], rtol=1e-5)  # float32
    assert np.isfinite(found.distance).all()


@pytest.mark.parametrize("factor", [0.01, 1.0, 100.0])
@pytest.mark.parametrize("kind", ["distance", "z", "disparity"])
def test_a_map_is_told_by_its_flat_walls_in_any_unit(kind, factor):
    panorama = Panorama(None, factor * MAPS[kind], VALID)
    for first in ("distance", "z"):
        kinds = (first, *(other for other in ("distance", "z", "disparity") if other != first))
        assert flattest_kind(panorama, kinds) == kind


def test_disparity_normalised_to_begin_at_0_is_told_too():
    inverse = (1 / DISTANCE - (1 / DISTANCE).min()) / np.ptp(1 / DISTANCE) + 1e-6
    assert flattest_kind(Panorama(None, inverse, VALID), ("distance", "z", "disparity")) == "disparity"


def test_a_map_that_tells_nothing_is_what_it_was_said_to_be():
    noise = np.exp(np.random.default_rng(0).standard_normal(DISTANCE.shape))
    constant = np.full(DISTANCE.shape, 2.0)
    for distance, valid in ((noise, VALID), (constant, VALID), (DISTANCE, np.zeros_like(VALID))):
        for kinds in (("z", "distance"), ("distance", "z")):
            assert flattest_kind(Panorama(None, distance, valid), kinds) == kinds[0]


@pytest.mark.parametrize(("factor", "words"), [(1.0, ""), (100.0, "so large"), (0.2, "so small"), (1e-4, "so small")])
def test_rooms_of_no_size_are_named(factor, words):
    said = implausible_size(Panorama(None, DISTANCE * factor, VALID))
    assert words in said and bool(said) == bool(words)
