"""Laws of the small parts: joints, noise, footprints, furniture tables."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.rooms.furniture.catalogue import PIECES, size_ranges
from rein3d_jax.rooms.furniture.footprints import Footprint, corners, distance_from_origin, footprints_overlap
from rein3d_jax.rooms.tracing.pattern import fractal_noise, joints


@pytest.mark.parametrize("footprint", [0.01, 0.2, 0.9])
def test_joints_are_the_mean_over_the_footprint(footprint):
    period, width = 0.3, 0.04
    x = np.linspace(-1, 1, 41)
    fine = x[:, None] + footprint * ((np.arange(20_000) + 0.5) / 20_000 - 0.5)
    inside = np.abs(fine - period * np.round(fine / period)) <= width / 2
    got = joints(jnp.array(x, jnp.float32), jnp.float32(period), jnp.float32(width), jnp.float32(footprint))
    np.testing.assert_allclose(got, inside.mean(1), atol=2e-3)  # 20 000 samples; float32 floor at a joint's edge


def test_noise_fades_with_the_footprint():
    x, y = jax.random.uniform(jax.random.key(0), (2, 4096), maxval=50.0)
    spread = [
        float(jnp.std(fractal_noise(x, y, jnp.float32(f), jnp.float32(0.7), jnp.uint32(1)))) for f in (0, 0.1, 0.4, 1)
    ]
    assert spread == sorted(spread, reverse=True) and spread[0] > 0.2 and spread[-1] == 0


def test_rectangles_overlap_exactly_when_a_point_is_in_both():
    keys = jax.random.split(jax.random.key(1), 4)
    n = 200
    centre = jax.random.uniform(keys[0], (2, n, 2), minval=-1, maxval=1)
    half = jax.random.uniform(keys[1], (2, n, 2), minval=0.1, maxval=0.7)
    angle = jax.random.uniform(keys[2], (2, n), maxval=6.0)
    heading = jnp.stack([jnp.cos(angle), jnp.sin(angle)], -1)
    a, b = (Footprint(centre[i], half[i], heading[i], jnp.tile(jnp.array([0.0, 1.0]), (n, 1))) for i in (0, 1))
    grid = np.stack(np.meshgrid(*[np.linspace(-1, 1, 101)] * 2), -1).reshape(-1, 2)

    def within(points, box, slack):
        c, s = box.heading[:, None, 0], box.heading[:, None, 1]
        d = points - box.centre[:, None]
        own = jnp.stack([c * d[..., 0] + s * d[..., 1], c * d[..., 1] - s * d[..., 0]], -1)
        return jnp.all(jnp.abs(own) <= box.half[:, None] + slack, axis=-1)

    c, s = a.heading[:, None, 0], a.heading[:, None, 1]
    points = grid[None] * a.half[:, None]
    points = a.centre[:, None] + jnp.stack(
        [c * points[..., 0] - s * points[..., 1], s * points[..., 0] + c * points[..., 1]], -1
    )
    surely, perhaps = (np.asarray(within(points, b, slack).any(-1)) for slack in (-1e-5, 0.02))
    got = np.asarray(footprints_overlap(a, b))
    assert np.all(got[surely]) and np.all(perhaps[got])  # the grid's cells are 0.014 m at most
    assert 20 < got.sum() < n - 20
    np.testing.assert_array_equal(got, footprints_overlap(b, a))
    above = b.replace(heights=b.heights + 1.0)
    assert not np.any(footprints_overlap(a, above))  # touching is not sharing
    nearest = np.linalg.norm(points, axis=-1).min(-1)
    np.testing.assert_allclose(distance_from_origin(a), nearest, atol=0.02)  # the grid again
    assert np.all(within(corners(a), a, 1e-5))


@pytest.mark.parametrize("name", PIECES)
@pytest.mark.parametrize("end", [0, 1])
def test_parts_keep_to_their_piece(name, end):
    """At the smallest and largest sizes no part reaches over its rectangle or under the floor."""
    width, depth, height, _ = size_ranges()[list(PIECES).index(name), :, end]
    terms = np.array([width, depth, height, 1.0])
    for part in PIECES[name].parts:
        x, y, z = ([bound @ terms for bound in bounds] for bounds in (part.x, part.y, part.z))
        if min(x[1] - x[0], y[1] - y[0], z[1] - z[0]) <= 0.002:
            continue  # left out: the piece has no room for it
        assert max(-x[0], x[1]) <= width / 2 + 1e-6, part
        assert y[1] <= depth / 2 + 1e-6, part
        assert y[0] >= -depth / 2 - 1e-6, part
        assert z[0] >= -1e-6, part
