"""Weights that are missing, damaged or something else are named in one line."""

import re

import numpy as np
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.io.weights.metric_weights import (
    METRIC_WEIGHTS,
    brisque_weights,
    i3d_weights,
    lpips_weights,
    niqe_weights,
)

LOADERS = {"lpips_alex": lpips_weights, "niqe": niqe_weights, "brisque": brisque_weights}


@pytest.mark.parametrize("name", LOADERS)
def test_what_is_shipped_loads(name):
    params = LOADERS[name]()
    assert all(array.dtype == np.float32 and np.isfinite(array).all() for array in params.values())


@pytest.mark.parametrize("name", LOADERS)
def test_damage_is_named(name, tmp_path):
    data, path = (METRIC_WEIGHTS / f"{name}.npz").read_bytes(), tmp_path / "damaged.npz"
    for broken in (b"", data[: len(data) // 2], data[:3000] + b"\0" * 500 + data[3500:]):
        path.write_bytes(broken)
        with pytest.raises(InputError, match=rf"(?s)^(?!.*\n).*{re.escape(str(path))}.*reinstall"):
            LOADERS[name](path)


def test_other_arrays_are_refused(tmp_path):
    path = tmp_path / "other.npz"
    np.savez(path, mean=np.zeros(36), whitening=np.zeros((36, 35)))
    with pytest.raises(InputError, match="does not hold"):
        niqe_weights(path)
    np.savez(path, mean=np.array([None]), whitening=np.zeros((36, 36)))
    with pytest.raises(InputError, match="never unpickled"):
        niqe_weights(path)


def test_i3d_says_how_to_make_its_file(tmp_path):
    with pytest.raises(InputError, match=r"i3d\.npz cannot be read.*convert.metrics i3d"):
        i3d_weights(tmp_path / "i3d.npz")
    with pytest.raises(InputError, match=r"does not hold.*convert.metrics i3d"):
        i3d_weights(METRIC_WEIGHTS / "niqe.npz")
