"""A stage is taken over by the very same job alone, and by the version of the package that made it."""

import jax.numpy as jnp
import pytest

from experiments.reconstruct import stage_store
from experiments.reconstruct.stage_store import StageStore
from rein3d_jax.refine import RefineConfig
from rein3d_jax.scene import Gaussians

SCENE = Gaussians(*(jnp.ones(shape) for shape in ((2, 3), (2, 3), (2, 4), (2,), (2, 1, 3))), jnp.ones(2, bool))


def taken_over(folder, depends="of it") -> bool:
    """Whether a resumed job finds the stage "lift" finished."""
    store = StageStore(folder, RefineConfig(), resume=True)
    store.run("lift", depends, lambda: SCENE)
    return store.finished[-1].found


@pytest.fixture
def made(tmp_path):
    assert not taken_over(tmp_path)
    return tmp_path


def test_the_same_job_takes_a_stage_over(made):
    assert taken_over(made)


def test_other_settings_make_it_again(made):
    assert not taken_over(made, "of something else")


def test_another_version_makes_it_again(made, monkeypatch):
    monkeypatch.setattr(stage_store, "__version__", "0.0.1")
    assert not taken_over(made)
