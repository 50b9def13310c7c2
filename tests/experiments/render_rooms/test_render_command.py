"""The command around Blender: rooms whole or not at all, runs that go on, failures that end it."""

from pathlib import Path

import pytest

from experiments.render_rooms import __main__ as command
from tests.experiments.render_rooms.catalogs import paper_catalog


class _PaperBlender:
    """Answers as Blender would; fails at the seeds in `broken`."""

    broken: frozenset[int] = frozenset()
    drawn: list[int] = []  # noqa: RUF012

    def __init__(self, python: Path, log: Path):
        pass

    def draw(self, plan: dict, folder: Path, settings: dict) -> str:
        folder.mkdir()
        (folder / "000.png").touch()
        if plan["seed"] in self.broken:
            return "failed: on paper"
        self.drawn.append(plan["seed"])
        return "done 1.0 1"

    def stop(self) -> None:
        pass


@pytest.fixture
def run(monkeypatch, tmp_path):
    monkeypatch.setattr(command, "BlenderProcess", _PaperBlender)
    monkeypatch.setattr(command, "load_catalog", lambda folder: paper_catalog())
    monkeypatch.setattr(_PaperBlender, "drawn", [])
    monkeypatch.setattr(_PaperBlender, "broken", frozenset())

    def with_options(*options: str) -> int:
        return command.main(["--output", str(tmp_path), "--assets", "a", "--blender", "b", *options])

    return with_options


def test_a_second_run_draws_what_is_missing(run, tmp_path):
    assert run("--rooms", "3") == 0
    (tmp_path / ".partial_000004_99").mkdir()  # left by a run that was killed
    assert run("--rooms", "5") == 0
    assert _PaperBlender.drawn == [0, 1, 2, 3, 4]
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"room_{seed:06d}" for seed in range(5)]


def test_a_room_that_failed_leaves_nothing_and_is_tried_again(run, tmp_path, monkeypatch):
    monkeypatch.setattr(_PaperBlender, "broken", frozenset({1}))
    assert run("--rooms", "3") == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["room_000000", "room_000002"]
    monkeypatch.setattr(_PaperBlender, "broken", frozenset())
    assert run("--rooms", "3") == 0
    assert _PaperBlender.drawn == [0, 2, 1]


def test_many_failures_in_a_row_end_the_run(run, capsys, monkeypatch):
    monkeypatch.setattr(_PaperBlender, "broken", frozenset(range(99)))
    assert run("--rooms", "50", "--walk-every", "0") == 2
    assert "in a row failed" in capsys.readouterr().err


def test_workers_draw_disjoint_rooms(run):
    assert run("--rooms", "4", "--worker", "1/2") == 0
    assert run("--rooms", "4", "--worker", "0/2") == 0
    assert _PaperBlender.drawn == [1, 3, 0, 2]
