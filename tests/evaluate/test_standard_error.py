"""The mean over rooms and its standard error, which shrinks as it should."""

import numpy as np
from scipy import stats

from rein3d_jax.evaluate.standard_error import over_rooms


def test_it_is_scipys():
    values = np.random.default_rng(0).normal(20, 3, (40, 4))
    result = over_rooms(values)
    np.testing.assert_allclose(result.mean, values.mean(axis=0), rtol=1e-6)  # float32
    np.testing.assert_allclose(result.sem, stats.sem(values), rtol=1e-5)
    assert (np.asarray(result.rooms) == 40).all()


def test_a_room_without_a_value_does_not_count():
    values = np.array([[1.0, 2.0], [np.nan, 4.0], [3.0, np.nan], [5.0, np.nan]])
    result = over_rooms(values)
    np.testing.assert_allclose(result.mean, [3, 3])
    np.testing.assert_allclose(result.sem, [stats.sem([1.0, 3, 5]), stats.sem([2.0, 4])], rtol=1e-6)
    assert result.rooms.tolist() == [3, 2]


def test_one_room_says_nothing_of_its_error_and_none_says_nothing():
    result = over_rooms(np.array([[7.0, np.nan], [np.nan, np.nan]]))
    assert result.mean[0] == 7 and np.isnan(result.mean[1]) and np.isnan(result.sem).all()
    assert result.rooms.tolist() == [1, 0]
