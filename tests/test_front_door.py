"""The package's front door: every name is there, none is imported before it is asked for."""

import subprocess
import sys

import pytest

import rein3d_jax as r3d


def test_every_name_opens_what_it_names():
    for name in r3d.__all__:
        found = getattr(r3d, name)
        assert getattr(found, "__name__", name).split(".")[-1] in (name, "Stages", "read_splats"), name
    assert r3d.read_gaussians is r3d.read_splats
    assert set(r3d.__all__) == set(dir(r3d))


def test_an_unknown_name_is_said():
    with pytest.raises(AttributeError, match=r"rein3d_jax.*recontsruct"):
        r3d.recontsruct  # noqa: B018


def test_nothing_heavy_is_imported_before_it_is_asked_for():
    """A worker that only reads InputError shall not wait for jax."""
    heavy = "{'jax', 'cv2', 'OpenImageIO', 'optax', 'flax'}"
    program = f"import sys, rein3d_jax as r3d; r3d.InputError; print(sorted({heavy} & sys.modules.keys()))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
