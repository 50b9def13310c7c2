"""Pickles give arrays and nothing else, and only the published archives are converted."""

import io
import pickle

import numpy as np
import pytest

from benchmarks.convert import metrics
from benchmarks.convert.array_pickle import load_arrays


def test_arrays_come_back():
    tree = {"a": [np.arange(6.0).reshape(2, 3), np.float32([1])], "b": {"c": 2, "d": "text"}}
    back = load_arrays(io.BytesIO(pickle.dumps(tree)))
    np.testing.assert_array_equal(back["a"][0], tree["a"][0])
    np.testing.assert_array_equal(back["a"][1], tree["a"][1])
    assert back["b"] == tree["b"]


class Trap:
    def __reduce__(self):
        return eval, ("1 + 1",)


@pytest.mark.parametrize("trap", [Trap(), {"a": Trap()}, eval, np.array([Trap()])])
def test_anything_else_is_refused(trap):
    with pytest.raises(pickle.UnpicklingError, match="refused"):
        load_arrays(io.BytesIO(pickle.dumps(trap)))


@pytest.mark.parametrize("data", [None, b"something else"])
def test_another_archive_is_refused(tmp_path, capsys, data):
    archive = tmp_path / "basicsr-1.4.2.tar.gz"
    if data is not None:
        archive.write_bytes(data)
    assert metrics.main(["niqe", str(archive), str(tmp_path / "out.npz")]) == 2
    error = capsys.readouterr().err
    assert str(archive) in error and error.count("\n") == 1
    assert not (tmp_path / "out.npz").exists()


def test_batch_normalisation_is_folded_in():
    """scale-free: gain 1 / sqrt(variance + 1e-3), offset bias - mean * gain."""
    rng = np.random.default_rng(0)
    kernel, bias, mean = rng.normal(size=(1, 1, 1, 3, 4)), rng.normal(size=4), rng.normal(size=4)
    variance, five = rng.uniform(0.5, 2, 4), (1, 1, 1, 1, 4)
    units = {"Conv_0": {"kernel": kernel}, "BatchNorm_0": {"bias": bias.reshape(five)}}
    linear = {"Conv_0": {"kernel": kernel, "bias": bias}}
    statistics = {"BatchNorm_0": {"mean": mean.reshape(five), "var": variance.reshape(five)}}
    tree = {"params": {"M": {"B/C": units}, "L": linear}, "batch_stats": {"M": {"B/C": statistics}}}
    folded = metrics.i3d(pickle.dumps(tree))
    assert set(folded) == {"M.B/C.kernel", "M.B/C.bias", "L.kernel", "L.bias"}
    x = rng.normal(size=3)
    expected = (x @ kernel[0, 0, 0] - mean) / np.sqrt(variance + 1e-3) + bias
    actual = x @ folded["M.B/C.kernel"][0, 0, 0] + folded["M.B/C.bias"]
    np.testing.assert_allclose(actual, expected, rtol=1e-5)  # stored in float32
