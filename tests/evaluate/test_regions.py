"""The regions of a view are what tracing rays to the origin says, up to the pixels along edges."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.ndimage import binary_dilation, binary_erosion

from rein3d_jax.evaluate.regions import DISOCCLUDED, NEVER_SEEN, OBSERVED, regions_of_view
from rein3d_jax.scene import Panorama

HEIGHT, WIDTH = 128, 256


@pytest.fixture(scope="module")
def panorama(box_room):
    distance = jnp.asarray(box_room.distance(np.zeros(3), box_room.rays(HEIGHT, WIDTH)), jnp.float32)
    return Panorama(rgb=jnp.zeros((HEIGHT, WIDTH, 3)), distance=distance, valid=jnp.ones((HEIGHT, WIDTH), bool))


def seen_from(box_room, origin):
    rays = box_room.rays(96, 192)
    true = box_room.distance(np.array(origin), rays)
    return jnp.array(origin), jnp.asarray(rays, jnp.float32), jnp.asarray(true, jnp.float32)


@pytest.mark.parametrize("origin", [(2.3, 0.1, 0.1), (0.4, 1.8, -0.3), (-1.5, -1.0, 0.5)])
def test_regions_are_what_rays_to_the_origin_say(panorama, box_room, origin):
    origin, rays, true = seen_from(box_room, origin)
    points = np.asarray(origin + rays * true[..., None], np.float64)
    hidden = box_room.hidden(points)
    region = np.asarray(regions_of_view(panorama, origin, rays, true))
    assert set(np.unique(region)) == {OBSERVED, DISOCCLUDED}
    # Two pixels: bilinear distances, and what lies 2 % and 2 cm behind the box counts as the box.
    outline = binary_dilation(hidden, iterations=2) & ~binary_erosion(hidden, iterations=2)
    assert hidden.sum() > 200
    np.testing.assert_array_equal((region == DISOCCLUDED)[~outline], hidden[~outline])
    assert ((region == DISOCCLUDED) != hidden).mean() < 0.007  # measured: 22 to 115 of 18432


def test_all_that_the_panorama_shows_is_observed(panorama, box_room):
    rays = jnp.asarray(box_room.rays(HEIGHT, WIDTH), jnp.float32)
    assert jnp.all(regions_of_view(panorama, jnp.zeros(3), rays, panorama.distance) == OBSERVED)


def test_what_nothing_is_known_of_was_never_seen(panorama, box_room):
    origin, rays, true = seen_from(box_room, (2.3, 0.1, 0.1))
    region = regions_of_view(panorama, origin, rays, true.at[:10].set(0.0))
    assert jnp.all((region == NEVER_SEEN) == (jnp.arange(96) < 10)[:, None])
    blind = panorama.replace(valid=jnp.zeros_like(panorama.valid), distance=jnp.full_like(panorama.distance, 7.0))
    assert jnp.all(regions_of_view(blind, origin, rays, true) == NEVER_SEEN)


def test_an_invalid_distance_decides_nothing(panorama, box_room):
    """Whatever number stands there."""
    origin, rays, true = seen_from(box_room, (0.4, 1.8, -0.3))
    hole = panorama.replace(valid=panorama.valid.at[40:60, 30:90].set(False))
    odd = hole.replace(distance=jnp.where(hole.valid, hole.distance, 1e-3))
    np.testing.assert_array_equal(regions_of_view(hole, origin, rays, true), regions_of_view(odd, origin, rays, true))
