"""What a job is foreseen to take: more for more work, and what it took when it is run again."""

import dataclasses

import pytest

from experiments.config import load_config
from experiments.reconstruct.config import ReconstructConfig
from experiments.reconstruct.diffusion_cost import restore_seconds, told_cost
from experiments.reconstruct.forecast import COUNTED, SecondsForecast, recalled

CONFIG = ReconstructConfig()
SECONDS = {stage: 10.0 + i for i, stage in enumerate(COUNTED)} | {"total": 91.0}


def forecast(tmp_path, config=CONFIG, rows=256, **changes) -> SecondsForecast:
    made = SecondsForecast(dataclasses.replace(config, **changes), rows, upsampled=False)
    made.file = tmp_path / "seconds.json"
    made.known = recalled(made.file)
    return made


def programs(compiling: float) -> dict:
    return {"trace": dict.fromkeys(COUNTED, 0.5), "compile": dict.fromkeys(COUNTED, compiling)}


def test_twice_the_rows_take_longer_in_every_stage_that_sees_the_picture(tmp_path):
    small, large = (forecast(tmp_path, rows=rows).work for rows in (256, 512))
    assert all(large[stage] > small[stage] for stage in ("read", "lift", "restore", "write"))


@pytest.fixture
def as_the_model(monkeypatch):
    """A machine as fast as the model's, by its calibration, on which any diffusion takes 10 s."""
    monkeypatch.setattr("experiments.reconstruct.forecast._calibration", lambda: 1.0)
    monkeypatch.setattr("experiments.reconstruct.forecast.restore_seconds", lambda *_: 10.0)


def test_a_job_is_foreseen_to_take_longer_with_every_row(tmp_path, as_the_model):
    """From 64 rows to 4096: first by little, since programs are most of it, at last nearly as the pixels do."""
    quick, rows = load_config(ReconstructConfig, "quick"), (64, 128, 256, 512, 1024, 2048, 4096)
    totals = [forecast(tmp_path, quick, rows=number).seconds()["total"] for number in rows]
    assert totals == sorted(set(totals))
    assert totals[1] < 1.1 * totals[0] and 2.5 * totals[-2] < totals[-1] < 4 * totals[-2]


def test_a_machine_that_is_half_as_fast_takes_twice_as_long_for_all_of_it(tmp_path, as_the_model, monkeypatch):
    fast = forecast(tmp_path).seconds()["total"]
    monkeypatch.setattr("experiments.reconstruct.forecast._calibration", lambda: 2.0)
    assert forecast(tmp_path).seconds()["total"] == pytest.approx(2 * fast, abs=1.0)  # stages are rounded


def test_a_path_is_expected_to_open_less_often_where_the_distance_is_given(tmp_path, as_the_model):
    closing = dataclasses.replace(CONFIG.explore, min_revealed=0.01)
    given, photo, all_paths = (
        forecast(tmp_path, **changes).seconds()
        for changes in ({"explore": closing}, PHOTO | {"explore": closing}, PHOTO)
    )
    for stage in ("restore", "refine"):
        assert given[stage] < photo[stage] < all_paths[stage]


def test_what_a_job_took_is_foreseen_for_the_next_one_like_it(tmp_path):
    forecast(tmp_path).remember(SECONDS, programs(0.2))
    again = forecast(tmp_path).seconds()
    assert {stage: again[stage] for stage in COUNTED} == pytest.approx({s: SECONDS[s] for s in COUNTED}, abs=0.1)


def test_after_compiling_the_next_one_is_foreseen_to_be_faster(tmp_path):
    forecast(tmp_path).remember(SECONDS, programs(4.0))
    assert forecast(tmp_path).seconds()["total"] < SECONDS["total"] - 7 * 2


SMALL, LARGER = (
    {"restore": load_config(ReconstructConfig, "paper_small", [f"restore.diffusion.network.dit.ffn={width}"]).restore}
    for width in (32, 64)
)
PHOTO = {"input": dataclasses.replace(CONFIG.input, distance=None)}


@pytest.mark.parametrize(
    ("one", "other", "stages"),
    [
        (SMALL, LARGER, {"restore", "peel"}),
        (LARGER, {}, {"restore", "peel"}),
        ({}, PHOTO, {"read"}),
    ],
)
def test_one_worker_tells_nothing_of_another(tmp_path, as_the_model, one, other, stages):
    """A network of another size, another restorer, a network that is asked beside a file that is read: what one took
    is in no forecast of the other's work; where the worker is the same, it is."""
    slow = forecast(tmp_path, **one)
    slow.remember({stage: 20 * slow.work[stage] + 1 for stage in COUNTED}, programs(0.5))
    told = forecast(tmp_path, **other)
    assert {stage for stage, slowness in told._slowness().items() if slowness == 1.0} == stages
    assert forecast(tmp_path, **one)._slowness() == pytest.approx(dict.fromkeys(COUNTED, 20.0))


def test_a_slower_machine_is_slower_for_other_sizes_too(tmp_path):
    first = forecast(tmp_path, rows=512)
    first.known = dict.fromkeys(first.workers.values(), 1.0)
    by_model = first.seconds()
    forecast(tmp_path, rows=256).remember({s: 100 * x for s, x in SECONDS.items()}, programs(0.2))
    assert forecast(tmp_path, rows=512).seconds()["lift"] > 5 * by_model["lift"]


@pytest.mark.parametrize("content", ["", "[1]", '{"slowness": {"read": 1}}', '{"slowness": 3}'])
def test_a_damaged_memory_is_no_memory(tmp_path, content):
    (tmp_path / "seconds.json").write_text(content)
    assert forecast(tmp_path).known == {}


def test_programs_are_shared_by_pictures_with_a_distance_and_without(tmp_path):
    """All but reading's: another picture of the same size finds the others compiled."""
    forecast(tmp_path).remember(SECONDS, programs(0.2))
    photo = forecast(tmp_path, input=dataclasses.replace(CONFIG.input, distance=None)).seconds()
    given = forecast(tmp_path).seconds()
    assert photo["read"] > given["read"] + 5 and all(photo[s] == given[s] for s in COUNTED if s != "read")


def test_the_diffusion_restorers_cost_is_told_and_is_in_the_forecast(tmp_path):
    """The paper's: 4 paths of 41 frames, 50 passes of 172.8 TFLOP and 310.9 of the VAE each."""
    paper = load_config(ReconstructConfig, "paper")
    told = told_cost(paper)
    assert "4 x 41 frames at most, 50 steps without guidance, 50 passes a path, 35,806 TFLOP" in told
    assert "H100 68.9 s" in told and "GiB" in told and told_cost(CONFIG) == ""  # as test_wan_cost.py checks
    few = load_config(ReconstructConfig, "paper", ["restore.diffusion.sample.steps=4"])
    assert 8 < restore_seconds(paper, 41) / restore_seconds(few, 41) < 12.5  # but for the VAE's share it were 12.5
    extra = forecast(tmp_path, paper).work["restore"] - restore_seconds(paper, 41)
    assert restore_seconds(CONFIG, 41) == 0 < extra < restore_seconds(paper, 41)
