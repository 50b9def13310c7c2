"""A budget: limits laid over the stages, paths that reveal too little left out."""

import json

import pytest

from experiments.reconstruct import __main__ as job
from experiments.reconstruct.budget import BudgetConfig, bytes_of_one, check_memory, foreseen_bytes, within
from rein3d_jax.errors import InputError
from rein3d_jax.pipeline.stages import Stages
from rein3d_jax.refine import RefineConfig

pytestmark = pytest.mark.slow  # whole jobs


UNSEEN = ("input.views=none", "film.step=10", "film.yaw_step=3")  # nothing here asks for views or a film


def run(recipe, output, *settings):
    changes = [item for setting in (*UNSEEN, *settings) for item in ("--set", setting)]
    assert job.main(["--config", str(recipe), "--output", str(output), *changes]) == 0
    return json.loads((output / "metrics.json").read_text())


@pytest.mark.parametrize(
    ("budget", "limit"),
    [({}, 0), ({"gaussians": 70}, 70), ({"bytes": 6800}, 100), ({"gaussians": 70, "bytes": 6800}, 70)],
)
def test_the_smaller_limit_counts(budget, limit):
    """68 bytes a Gaussian of degree 0."""
    stages = Stages(refine=RefineConfig(sh_degree=0))
    assert within(stages, BudgetConfig(**budget)).refine.max_count == limit
    assert within(stages, BudgetConfig()) == stages


def test_a_panorama_that_does_not_fit_is_refused_with_one_that_does():
    check_memory(1024, foreseen_bytes(1024))
    with pytest.raises(InputError, match=r"4096 x 2048 pixels take about .* GB .*: set input.height = 1024") as refused:
        check_memory(2048, foreseen_bytes(1024))
    assert str(refused.value).count("\n") == 0
    with pytest.raises(InputError, match="take a machine with more"):
        check_memory(64, 10**9)


@pytest.mark.parametrize("bad", [{"gaussians": -1}, {"bytes": 10}, {"seconds": -1.0}, {"tolerance": -0.1}])
def test_a_budget_that_holds_nothing_is_refused_by_name(bad):
    with pytest.raises(InputError, match=next(iter(bad))):
        within(Stages(refine=RefineConfig(sh_degree=0)), BudgetConfig(**bad))


def test_a_run_keeps_to_its_bytes_and_says_so(recipe, tmp_path):
    limit = 5000 * bytes_of_one(0)
    metrics = run(recipe, tmp_path / "run", f"budget.bytes={limit}", "refine.steps=2")
    header = 1000  # bytes, of text
    assert metrics["count"]["refined"] <= 5000
    assert metrics["bytes"]["scene.ply"] == (tmp_path / "run" / "scene.ply").stat().st_size <= limit + header


def test_paths_that_reveal_too_little_are_left_out(recipe, tmp_path):
    unpeeled = ("peel.room=false", "peel.outside=false")
    metrics = run(recipe, tmp_path / "run", "explore.min_revealed=0.99", "refine.densification=none", *unpeeled)
    assert metrics["paths"] and not any(path["restored"] for path in metrics["paths"])
    assert metrics["count"]["refined"] == metrics["count"]["lift"]
