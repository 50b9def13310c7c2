"""The frame of the commands: a list without imports, recipes by name, every key told, one line where input is bad."""

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from experiments.command import CommandParser
from experiments.command_list import run_listed
from experiments.config import RECIPES, load_config, recipe_path
from experiments.keys import MARKS, keys_text, with_keys
from rein3d_jax.errors import InputError
from rein3d_jax.settings import Settings, setting

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class PaintConfig(Settings):
    """Paint on a wall."""

    coats: int = setting(2, "of one colour", within="[1, inf)")
    colour: str = setting("white", "of the last coat", among=("white", "red"))


@dataclass(frozen=True)
class WallConfig(Settings):
    """A wall."""

    height: float = setting(2.5, "above the floor", within="(0, inf)", unit="metres")
    paint: PaintConfig = PaintConfig(coats=3)


def run(work, *arguments):
    parser = CommandParser("wall", "A wall is built.\n\nMore.")
    parser.add_recipe(WallConfig)
    return parser.run(work, list(arguments))


def test_every_command_has_a_line_and_none_is_imported():
    script = "import sys; from experiments.__main__ import main; main([]); sys.exit('jax' in sys.modules)"
    listed = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    lines = dict(line.split(maxsplit=1) for line in listed.stdout.splitlines())
    folders = {path.parent.name for path in (ROOT / "experiments").glob("*/__main__.py")}
    assert lines.keys() == folders | {"keys"}
    assert all(line.endswith(".") for line in lines.values())


def test_a_listed_command_runs_and_an_unknown_one_names_the_closest(tmp_path, capsys):
    empty = tmp_path / "README.md"
    empty.write_text("No marks.\n")
    assert run_listed("experiments", ["keys", "--into", str(empty)]) == 2
    assert f"keys: {empty}: needs the lines" in capsys.readouterr().err
    assert run_listed("experiments", ["evalaute"]) == 2
    assert capsys.readouterr().err == "experiments: evalaute is no command; did you mean evaluate?\n"


def test_a_fault_of_the_input_is_one_line_and_exit_code_2(capsys):
    def refuse(options):
        raise InputError(f"{options.config} has no door")

    assert run(refuse, "--config", "w.toml") == 2
    assert capsys.readouterr().err == "wall: w.toml has no door\n"
    assert run(lambda options: None, "--config", "w.toml") == 0
    with pytest.raises(SystemExit, match="2"):
        run(refuse)  # --config is missing


def test_a_packaged_recipe_goes_by_its_name_anywhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert recipe_path("quick") == recipe_path("quick.toml") == RECIPES / "quick.toml"
    with pytest.raises(InputError, match=r"quik is no file, and no packaged recipe; those are .*quick.*check --config"):
        recipe_path("quik")
    Path("quick.toml").write_text("height = 3\n")
    assert load_config(WallConfig, "quick.toml") == WallConfig(3.0)  # one's own file comes first
    with pytest.raises(InputError, match=r"here/quick.toml: the recipe cannot be read"):
        load_config(WallConfig, "here/quick.toml")


def test_keys_are_told_with_default_range_unit_and_meaning(capsys):
    with pytest.raises(SystemExit, match="0"):
        run(None, "--keys")
    said = capsys.readouterr().out
    assert said == keys_text(WallConfig)
    assert "height = 2.5  # above the floor, metres (in (0, inf))\n" in said
    assert "[paint]\n# Paint on a wall.\ncoats = 3  # of one colour (in [1, inf))\n" in said
    assert 'colour = "white"  # of the last coat (one of white, red)\n' in said


def test_the_readme_has_all_keys():
    """After a change: python -m experiments.keys --into experiments/README.md"""
    text = (ROOT / "experiments" / "README.md").read_text("utf-8")
    assert with_keys(text) == text


def test_every_key_has_a_meaning(capsys):
    assert run_listed("experiments", ["keys"]) == 0
    rows = [line.split(" | ") for line in capsys.readouterr().out.splitlines() if line.startswith("| `")]
    assert len(rows) > 200 and [row for row in rows if not row[-1].removesuffix(" |")] == []


def test_keys_stand_between_the_marks(monkeypatch):
    begin, end = MARKS
    monkeypatch.setattr("experiments.keys._recipes", lambda: {"wall": (WallConfig,), "paint": (PaintConfig,)})
    text = with_keys(f"Before.\n{begin}old\n{end}After.\n")
    assert text.startswith(f"Before.\n{begin}") and text.endswith(f"{end}After.\n") and "old" not in text
    assert "| `height` | `2.5` | metres | in (0, inf) | above the floor |" in text
    assert "The recipe: as `[paint]` of wall, but `coats = 2`." in text
    assert text == with_keys(text)
    with pytest.raises(InputError, match="needs the lines"):
        with_keys("nothing")
