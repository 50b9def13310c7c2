"""Distance errors are their definitions written out in a loop over the masked pixels."""

import numpy as np
import pytest

from rein3d_jax.evaluate.distance_error import distance_errors

HEIGHT, WIDTH = 16, 32


@pytest.fixture(scope="module")
def maps():
    rng = np.random.default_rng(0)
    true = rng.uniform(1, 5, (HEIGHT, WIDTH)).astype(np.float32)
    estimate = (true * rng.uniform(0.6, 1.5, true.shape)).astype(np.float32)
    true[2:4, 5:9] = 0.0  # unknown
    return estimate, true, rng.uniform(size=true.shape) < 0.7


def test_they_are_their_definitions(maps):
    estimate, true, mask = (np.asarray(a, np.float64) for a in maps)
    terms, weights = [], []
    for v, u in np.ndindex(HEIGHT, WIDTH):
        if mask[v, u] and true[v, u] > 0:
            d, t = estimate[v, u], true[v, u]
            terms.append((abs(d - t) / t, (d - t) ** 2, max(d / t, t / d) < 1.25))
            weights.append(np.cos(np.pi * v / HEIGHT) - np.cos(np.pi * (v + 1) / HEIGHT))  # the band's area
    abs_rel, square, delta = np.average(terms, axis=0, weights=weights)
    np.testing.assert_allclose(distance_errors(*maps), (abs_rel, np.sqrt(square), delta), rtol=1e-5)  # float32 sums


def test_the_truth_has_no_error_and_a_scale_a_known_one(maps):
    _, true, mask = maps
    np.testing.assert_allclose(distance_errors(true, true, mask), (0, 0, 1), atol=3e-6)  # sums of 512: sqrt(512) * 6e-8
    errors = distance_errors(1.3 * true, true, mask)
    np.testing.assert_allclose(errors.abs_rel, 0.3, rtol=1e-5)  # float32
    assert errors.delta == 0


def test_a_hole_is_wrong_and_an_unknown_truth_does_not_count(maps):
    _, true, _ = maps
    everywhere = np.ones_like(true, bool)
    errors = distance_errors(np.zeros_like(true), true, everywhere)
    np.testing.assert_allclose((errors.abs_rel, errors.delta), (1, 0), rtol=3e-6)  # as above
    odd = np.where(true > 0, true, 1e6).astype(np.float32)
    assert distance_errors(odd, true, everywhere).rmse == 0


def test_an_empty_mask_has_no_error(maps):
    estimate, true, _ = maps
    assert np.isnan(distance_errors(estimate, true, np.zeros_like(true, bool))).all()


def test_each_map_of_a_batch_has_its_own_errors(maps):
    estimate, true, mask = maps
    both = distance_errors(np.stack([estimate, true]), np.stack([true, true]), mask)
    np.testing.assert_allclose(np.array(both)[:, 0], distance_errors(*maps), rtol=1e-5)
