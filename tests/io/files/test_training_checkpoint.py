"""Of a training run's states the last and the best stay, whole, and what does not fit is refused by name."""

import numpy as np
import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.training_checkpoint import TrainingCheckpoints


def state(step: int) -> dict:
    rng = np.random.default_rng(step)
    return {"step": np.array(step, np.int32), "layer": {"kernel": rng.normal(size=(3, 5)).astype(np.float32)}}


LIKE = state(0)


def saved(folder, scores):
    """States 1, 2, ... with `scores`, in one run."""
    with TrainingCheckpoints(folder) as checkpoints:
        for step, score in enumerate(scores, start=1):
            checkpoints.save(step, state(step), score)


def kept(folder) -> set[int]:
    return {int(path.name) for path in folder.iterdir() if path.name.isdigit()}


@pytest.mark.parametrize(
    ("scores", "best"), [((0.5, 0.9, 0.1, 0.3), 2), ((3.0, 2.0, 1.0), 1), ((1.0, 2.0), 2), ((-np.inf, -1.0, -2.0), 2)]
)
def test_the_last_and_the_best_stay_and_others_go(tmp_path, scores, best):
    saved(tmp_path, scores)
    assert kept(tmp_path) == {best, len(scores)}
    with TrainingCheckpoints(tmp_path) as checkpoints:  # as a resumed run finds them
        assert (checkpoints.last(), checkpoints.best()) == (len(scores), best)
        assert checkpoints.best_score() == scores[best - 1]


def test_a_state_returns_to_the_bit(tmp_path):
    saved(tmp_path, (0.5, 0.1))
    with TrainingCheckpoints(tmp_path) as checkpoints:
        for step in (1, 2):
            found = checkpoints.restore(step, LIKE)
            np.testing.assert_array_equal(found["layer"]["kernel"], state(step)["layer"]["kernel"])
            assert int(found["step"]) == step and found["layer"]["kernel"].dtype == np.float32


def test_a_resumed_run_remembers_the_best_of_before(tmp_path):
    saved(tmp_path, (0.9, 0.1))
    with TrainingCheckpoints(tmp_path) as checkpoints:
        checkpoints.save(3, state(3), 0.5)
    assert kept(tmp_path) == {1, 3}


def test_an_empty_folder_has_neither_last_nor_best(tmp_path):
    with TrainingCheckpoints(tmp_path / "new") as checkpoints:
        assert checkpoints.last() is None and checkpoints.best() is None and checkpoints.best_score() == -np.inf


def test_a_run_that_was_never_judged_has_a_last(tmp_path):
    saved(tmp_path, (-np.inf, -np.inf))
    with TrainingCheckpoints(tmp_path) as checkpoints:
        assert checkpoints.last() == 2 and checkpoints.best_score() == -np.inf


@pytest.mark.parametrize(
    "other",
    [
        LIKE | {"layer": {"kernel": np.zeros((3, 6), np.float32)}},
        LIKE | {"layer": {"weight": np.zeros((3, 5), np.float32)}},
        LIKE | {"more": np.zeros(2, np.float32)},
    ],
    ids=["shape", "name", "more"],
)
def test_a_state_of_another_network_is_refused_by_name(tmp_path, other):
    saved(tmp_path, (0.5,))
    with TrainingCheckpoints(tmp_path) as checkpoints, pytest.raises(InputError) as caught:
        checkpoints.restore(1, other)
    assert str(tmp_path / "1") in str(caught.value) and "\n" not in str(caught.value)


def test_a_damaged_checkpoint_is_refused_by_name(tmp_path):
    saved(tmp_path, (0.5,))
    for path in (tmp_path / "1" / "default").rglob("*"):
        if path.is_file():
            path.write_bytes(b"")
    with TrainingCheckpoints(tmp_path) as checkpoints, pytest.raises(InputError, match="does not fit this run"):
        checkpoints.restore(1, LIKE)
