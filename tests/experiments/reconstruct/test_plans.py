"""A budget of seconds: the best of the measured plans that is foreseen to keep to it."""

import dataclasses
import json
from pathlib import Path

import pytest

from experiments.config import changed, load_config
from experiments.reconstruct.config import ReconstructConfig
from experiments.reconstruct.plans import PLANS, planned

QUICK = load_config(ReconstructConfig, "quick")
NAMES = [plan.name for plan in PLANS]
MEASURED = Path(__file__).parents[3] / "benchmarks/results/plans.json"


def with_seconds(seconds):
    return changed(QUICK, [f"budget.seconds={seconds}"])


def rising(config):
    """Seconds by a plan's place in the list: 10, 20, 30, ..."""
    laid = [changed(config, plan.settings) for plan in PLANS]
    return 10.0 * (1 + laid.index(config))


@pytest.mark.parametrize("index", range(len(PLANS)))
def test_the_best_plan_that_fits_is_chosen_to_the_second(index):
    seconds = 10.0 * (1 + index)
    for enough in (seconds, seconds + 9.9):
        config, name = planned(with_seconds(enough), rising)
        assert name == NAMES[index]
        assert config == changed(with_seconds(enough), PLANS[index].settings)


def test_where_none_fits_the_fastest_is_taken():
    assert planned(with_seconds(1.0), rising)[1] == NAMES[0]


def test_without_a_budget_nothing_is_changed_or_foreseen():
    assert planned(QUICK, seconds_of=None) == (QUICK, "")


@pytest.mark.parametrize("recipe", ["draft", "paper"])
def test_a_plan_leaves_what_it_does_not_name(recipe):
    config = changed(load_config(ReconstructConfig, recipe), ["budget.seconds=1", "seed=7"])
    laid, _ = planned(config, lambda _: 0.0)
    assert (laid.seed, laid.restore.method, laid.budget) == (7, config.restore.method, config.budget)
    same = ("input", "lift", "restore", "explore", "refine", "film")
    assert dataclasses.replace(laid, **{name: getattr(config, name) for name in same}) == config


def test_plans_stand_in_the_order_that_was_measured():
    """Each costs more of the processor's seconds than the one before, and brings more decibels."""
    rows = json.loads(MEASURED.read_text())["novel_views"]
    for figure in ("cpu_seconds", "psnr"):
        found = [rows[name][figure]["mean"] for name in NAMES]
        assert found == sorted(found), figure
