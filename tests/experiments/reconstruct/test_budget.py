"""A budget: limits laid over the stages, paths that reveal too little left out; memory foreseen, and refused."""

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from experiments.reconstruct import __main__ as job
from experiments.reconstruct.budget import BudgetConfig, bytes_of_one, check_memory, foreseen_bytes, within
from rein3d_jax.errors import InputError
from rein3d_jax.lift import LiftConfig
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


def test_more_tolerance_models_less_and_never_undoes_what_the_recipe_gave_up():
    def limits(stages):
        return stages.lift.worth, stages.explore.min_revealed, stages.refine.plateau, -stages.lift.share

    loose = Stages(lift=LiftConfig(share=0.5, worth=0.4))
    for stages in (Stages(), loose):
        some, more = (limits(within(stages, BudgetConfig(tolerance=decibels))) for decibels in (0.1, 1.0))
        assert all(a <= b <= c for a, b, c in zip(limits(stages), some, more, strict=True))
    assert limits(within(Stages(), BudgetConfig(tolerance=0.2)))[0] == pytest.approx(0.007)
    assert within(Stages(), BudgetConfig(tolerance=0.1)).lift.share < 1  # else no Gaussian has to be worth it
    assert within(loose, BudgetConfig(tolerance=1.0)).lift == loose.lift


OF_PHOTO = partial(foreseen_bytes, share=0.5, estimated=True)
GROWTH = Path(__file__).parents[3] / "benchmarks/results/growth.json"


def test_a_panorama_that_does_not_fit_is_refused_with_one_that_does():
    check_memory(1024, OF_PHOTO(1024), OF_PHOTO)
    with pytest.raises(InputError, match=r"4096 x 2048 pixels take about .* GB .*: set input.height = 1024") as refused:
        check_memory(2048, OF_PHOTO(1024), OF_PHOTO)
    assert str(refused.value).count("\n") == 0
    assert f"{OF_PHOTO(2048) / 1e9:.1f} GB of memory, and there are {OF_PHOTO(1024) / 1e9:.1f} GB" in str(refused.value)
    with pytest.raises(InputError, match="take a machine with more"):
        check_memory(64, 10**9, OF_PHOTO)


def test_memory_grows_with_rows_and_gaussians_and_the_network():
    by_rows = [OF_PHOTO(rows) for rows in (128, 256, 512, 1024, 2048, 4096)]
    assert by_rows == sorted(set(by_rows))
    by_share = [foreseen_bytes(512, share, estimated=False) for share in (0.0, 0.25, 0.5, 1.0)]
    assert by_share == sorted(set(by_share)) and by_share[2] < OF_PHOTO(512)
    rises = np.diff([OF_PHOTO(rows) for rows in (1024, 2048, 4096)])  # four times the pixels each
    assert rises[1] == pytest.approx(4 * rises[0], rel=1e-6)


def test_memory_that_was_measured_is_foreseen_to_a_fifth():
    """`python -m benchmarks.time --photo` of a photo alone: first runs, with compilers."""
    for name, runs in json.loads(GROWTH.read_text())["this"].items():
        assert OF_PHOTO(int(name.split()[0])) == pytest.approx(runs["first"]["peak_bytes"], rel=0.2), name


def test_a_job_that_cannot_fit_writes_nothing(recipe, tmp_path, monkeypatch, capsys):
    """The line comes before any stage, and before the folder."""
    monkeypatch.setattr("experiments.reconstruct.job.machine_bytes", lambda: 10**9)
    assert job.main(["--config", str(recipe), "--output", str(tmp_path / "run")]) == 2
    told = capsys.readouterr()
    assert told.err.count("\n") == 1 and " GB of memory, and there are 1.0 GB: take a machine with more" in told.err
    assert not told.out and not (tmp_path / "run").exists()


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
    unpeeled = ("peel.room=false", "peel.outside=false", "peel.lining=false")
    metrics = run(recipe, tmp_path / "run", "explore.min_revealed=0.99", "refine.densification=none", *unpeeled)
    assert metrics["paths"] and not any(path["restored"] for path in metrics["paths"])
    assert metrics["count"]["refined"] == metrics["count"]["lift"]
