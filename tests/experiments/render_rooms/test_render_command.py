"""The command around Blender: rooms whole or not at all, runs that go on, failures that end it."""

import json
from pathlib import Path

import pytest

from experiments.render_rooms import __main__ as command
from tests.experiments.render_rooms.catalogs import paper_catalog

EMPTIED = {"000.png", "000.npz", "000_empty.png", "000_empty.npz", "000_exit.npz", "room.json"}


class _PaperBlender:
    """Answers as Blender would; fails at the seeds in `broken`."""

    broken: frozenset[int] = frozenset()
    drawn: list[int] = []  # noqa: RUF012

    def __init__(self, python: Path, log: Path):
        pass

    def draw(self, plan: dict, folder: Path, settings: dict) -> str:
        folder.mkdir()
        assert not settings["emptied"] or (Path(settings["furnished"]) / "000.npz").exists()
        for stem in [f"000_{part}" for part in settings["emptied"]] or ["000"]:
            for end in (".npz",) if stem == "000_exit" else (".png", ".npz"):
                (folder / f"{stem}{end}").touch()
        if plan["seed"] in self.broken:
            return "failed: on paper"
        if not settings["emptied"]:
            taken = [{**panorama, "gains": [1.0, 1.0, 1.0], "seconds": 1.0} for panorama in plan["panoramas"]]
            (folder / "room.json").write_text(json.dumps({**plan, "panoramas": taken}))
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


def test_emptied_pictures_join_finished_rooms_and_are_drawn_once(run, tmp_path, monkeypatch):
    assert run("--rooms", "4") == 0
    _PaperBlender.drawn.clear()
    (tmp_path / ".partial_empty_000002_99").mkdir()
    monkeypatch.setattr(_PaperBlender, "broken", frozenset({1}))
    assert run("--empty") == 0
    monkeypatch.setattr(_PaperBlender, "broken", frozenset())
    assert run("--empty") == 0
    assert _PaperBlender.drawn == [0, 2, 3, 1]
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"room_{seed:06d}" for seed in range(4)]
    assert all({path.name for path in room.iterdir()} == EMPTIED for room in tmp_path.iterdir())


def test_only_what_a_room_lacks_is_drawn(run, tmp_path):
    assert run("--rooms", "3") == 0
    assert run("--empty") == 0
    kept = tmp_path / "room_000001" / "000_empty.png"
    kept.write_text("rendered before there were exits")
    for name in ("room_000001/000_exit.npz", "room_000002/000_empty.png"):
        (tmp_path / name).unlink()
    _PaperBlender.drawn.clear()
    assert run("--empty") == 0
    assert _PaperBlender.drawn == [1, 2]
    assert kept.read_text()
    assert all({path.name for path in room.iterdir()} == EMPTIED for room in tmp_path.iterdir())


def test_rooms_of_other_panoramas_are_skipped_and_counted(run, capsys):
    assert run("--rooms", "4", "--walk-every", "0") == 0
    _PaperBlender.drawn.clear()
    assert run("--empty") == 0  # expects a walk in room 3
    assert _PaperBlender.drawn == [0, 1, 2]
    assert "1 rooms skipped" in capsys.readouterr().out
