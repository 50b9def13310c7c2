"""Any pytree comes back as it was, the same bytes for the same tree; a file that does not fit is refused by name."""

import os
import pickle

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.conventions import PINHOLE
from rein3d_jax.errors import InputError
from rein3d_jax.io.files.checkpoint import load, save
from rein3d_jax.scene import Camera


def tree(scale=1.0):
    camera = Camera(jnp.eye(4), jnp.full(2, scale), jnp.zeros(2), PINHOLE, 8, 6)
    steps = {"count": np.int64(2**40), "file": np.arange(3, dtype=np.uint8), "a/b": np.float64(0.1)}
    return {"camera": camera, "steps": steps, "pair": (jnp.zeros((0, 3)), None, [jnp.array(True)]), "seed": 7}


def assert_same(got, wanted):
    assert jax.tree.structure(got) == jax.tree.structure(wanted)
    for a, b in zip(jax.tree.leaves(got), jax.tree.leaves(wanted), strict=True):
        np.testing.assert_array_equal(a, b)
        assert np.asarray(a).dtype == np.asarray(b).dtype and isinstance(a, jax.Array) == isinstance(b, jax.Array)


def test_round_trip(tmp_path):
    save(tmp_path / "x.npz", tree())
    assert_same(load(tmp_path / "x.npz", tree(2.0)), tree())


def test_a_bare_array_and_an_empty_tree(tmp_path):
    for wanted in (jnp.arange(4.0), {}, None):
        save(tmp_path / "x.npz", wanted)
        assert_same(load(tmp_path / "x.npz", wanted), wanted)


def test_shapes_come_from_the_file_and_structure_from_like(tmp_path):
    save(tmp_path / "x.npz", {"a": jnp.arange(5.0)})
    got = load(tmp_path / "x.npz", {"a": jax.ShapeDtypeStruct((), jnp.float32)})
    np.testing.assert_array_equal(got["a"], np.arange(5.0))
    assert isinstance(got["a"], jax.Array)


def test_same_tree_same_bytes(tmp_path):
    save(tmp_path / "a.npz", tree())
    save(tmp_path / "b.npz", tree())
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    with np.load(tmp_path / "a.npz", allow_pickle=False) as stored:  # plain NPZ, readable leaf names
        assert "['camera'].focal" in stored.files


def test_leaves_that_do_not_fit_are_named(tmp_path):
    save(tmp_path / "x.npz", {"a": np.zeros(2), "b": np.zeros(2)})
    with pytest.raises(InputError, match=r"x.npz has \['b'\], which is unknown; lacks \['c'\]: remove it and run"):
        load(tmp_path / "x.npz", {"a": np.zeros(2), "c": np.zeros(2)})
    with pytest.raises(InputError, match=r"has \['b'\] as float64, not int32"):
        load(tmp_path / "x.npz", {"a": np.zeros(2), "b": np.zeros(2, np.int32)})


def test_missing_truncated_corrupt_and_pickled_files(tmp_path):
    path, like = tmp_path / "x.npz", {"a": np.arange(1000.0)}
    with pytest.raises(InputError, match=r"x.npz cannot be read"):
        load(path, like)
    save(path, like)
    whole = path.read_bytes()
    flipped = bytearray(whole)
    flipped[4000] ^= 1
    for damaged in (b"", whole[:100], whole[:-1], whole[: len(whole) // 2], bytes(flipped), pickle.dumps(like)):
        path.write_bytes(damaged)
        with pytest.raises(InputError, match=r"x.npz is damaged") as caught:
            load(path, like)
        assert "\n" not in str(caught.value)


def test_objects_are_never_stored(tmp_path):
    with pytest.raises(AssertionError, match=r"\['a'\] is object"):
        save(tmp_path / "x.npz", {"a": np.array([None])})
    assert not os.listdir(tmp_path)


def test_disk_full_keeps_the_earlier_file(tmp_path, file_size_limit):
    path = tmp_path / "x.npz"
    save(path, {"a": np.zeros(10)})
    with file_size_limit(2000), pytest.raises(InputError, match=r"x.npz cannot be written .*free some space"):
        save(path, {"a": np.zeros(10_000)})
    np.testing.assert_array_equal(load(path, {"a": np.ones(1)})["a"], np.zeros(10))
    assert os.listdir(tmp_path) == ["x.npz"]
