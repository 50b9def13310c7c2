"""A training run's log: a line of JSON for each record, whatever the numbers, and TensorBoard events beside it."""

import json

import numpy as np

from rein3d_jax.io.files.training_log import TrainingLog


def strict(line: str) -> dict:
    """JSON proper: Python alone reads NaN."""

    def refuse(name):
        raise ValueError(name)

    return json.loads(line, parse_constant=refuse)


def lines(folder) -> list[dict]:
    return [strict(line) for line in (folder / "log.jsonl").read_text("utf-8").splitlines()]


def test_a_line_is_a_record(tmp_path):
    with TrainingLog(tmp_path / "new" / "run") as log:
        log.record(1, {"loss": np.float32(0.5), "skipped": 0})
        log.record(3, {"held_out": 1e-12})
    assert lines(tmp_path / "new" / "run") == [{"step": 1, "loss": 0.5, "skipped": 0.0}, {"step": 3, "held_out": 1e-12}]


def test_what_is_not_finite_becomes_null(tmp_path):
    with TrainingLog(tmp_path) as log:
        log.record(2, {"loss": np.nan, "gradient": np.float32(np.inf), "score": -np.inf, "rate": 0.1})
    assert lines(tmp_path) == [{"step": 2, "loss": None, "gradient": None, "score": None, "rate": 0.1}]


def test_a_record_is_on_disk_before_the_run_ends(tmp_path):
    with TrainingLog(tmp_path) as log:
        log.record(1, {"loss": 1.0})
        assert lines(tmp_path) == [{"step": 1, "loss": 1.0}]


def test_a_resumed_run_goes_on_below(tmp_path):
    for step in (1, 2):
        with TrainingLog(tmp_path) as log:
            log.record(step, {"loss": 1.0 / step})
    assert lines(tmp_path) == [{"step": 1, "loss": 1.0}, {"step": 2, "loss": 0.5}]


def test_tensorboard_gets_numbers_and_pictures(tmp_path):
    with TrainingLog(tmp_path) as log:
        log.record(7, {"loss": 0.25})
        log.picture(7, "held_out", np.random.default_rng(0).random((8, 16, 3)) * 3 - 1)  # cut to [0, 1], not wrapped
    (events,) = tmp_path.glob("events.out.tfevents.*")
    content = events.read_bytes()
    assert b"loss" in content and b"held_out" in content and b"PNG" in content
