"""What the READMEs say holds: their Python runs, their commands are CI's, every link, file and command is there."""

import os
import re
from pathlib import Path

import pytest

from experiments.command_list import commands
from rein3d_jax import __version__

ROOT = Path(__file__).resolve().parents[1]
CARD = ROOT / "README.md"  # the owner's card: for the person with a photo
READMES = [CARD, *(ROOT / folder / "README.md" for folder in ("rein3d_jax", "experiments", "benchmarks"))]
PAPERS = [*READMES, *(ROOT / name for name in ("CONTRIBUTING.md", "CHANGELOG.md", "NOTICE", "CITATION.cff"))]
MAX_LINES = 150  # of the card

BLOCK = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\(([^)#]+)[^)]*\)")
NAMED = re.compile(r"`([\w.]+(?:/[\w.]+)*/?)`")  # words in backquotes that may be paths
SUFFIXES = (".py", ".md", ".toml", ".json", ".png", ".jpg", ".ipynb", ".txt", ".cff", "/")
WRITTEN = ("runs/", "stages/", "export/", "room_000123/")  # by a run
COMMAND = re.compile(r"(?:\brein3d |python -m experiments\.)([a-z]\w*)")
MEASUREMENT = re.compile(r"python -m benchmarks[ .]([a-z][\w.]*\w)")


def blocks(text: str) -> list[str]:
    """The Python blocks of a Markdown text."""
    return BLOCK.findall(text)


def missing_files(paper: Path, text: str) -> list[str]:
    """Links and named files that lead nowhere, seen from the paper's folder or from the repository's top."""
    links = [link for link in LINK.findall(text) if "://" not in link]
    named = [name for name in NAMED.findall(text) if "/" in name and name.endswith(SUFFIXES)]
    named = [name for name in named if not name.startswith(WRITTEN)]
    places = (paper.parent, ROOT)
    return [name for name in links + named if not any((place / name).exists() for place in places)]


def missing_commands(text: str) -> list[str]:
    """`rein3d NAME`, `python -m experiments.NAME` and `python -m benchmarks NAME` of what has no such name."""
    found = {("experiments", name) for name in COMMAND.findall(text)}
    found |= {("benchmarks", name) for name in MEASUREMENT.findall(text)}
    return [f"{folder} {name}" for folder, name in sorted(found) if name not in commands(ROOT / folder)]


def outside(text: str) -> list[str]:
    """Lines that point at papers which a reader of this repository does not have."""
    return [line for line in text.splitlines() if re.search(r"\.\./shared|shared/|\bissue \d|design\.md", line)]


@pytest.mark.slow
@pytest.mark.parametrize("paper", READMES, ids=lambda path: path.parent.name)
def test_python_in_the_readme_runs(paper, tmp_path, monkeypatch):
    """In one namespace, in order; files are written to a temporary folder that also shows the repository's own."""
    for entry in ROOT.iterdir():
        if not entry.name.startswith(".") and entry.name != "runs":
            os.symlink(entry, tmp_path / entry.name)
    monkeypatch.chdir(tmp_path)
    namespace = {"__name__": "readme"}
    for block in blocks(paper.read_text("utf-8")):
        exec(compile(block, str(paper), "exec"), namespace)


def test_the_card_is_short():
    assert len(CARD.read_text("utf-8").splitlines()) <= MAX_LINES


def test_the_two_commands_are_those_that_ci_runs():
    section = CARD.read_text("utf-8").partition("## Two commands")[2].partition("\n## ")[0]
    commands = [line.strip() for line in section.splitlines() if line.startswith("    ") and " && " in line]
    assert len(commands) == 2
    run = (ROOT / ".ci/run").read_text("utf-8").replace("--quiet ", "")
    assert all(part in run for command in commands for part in command.split(" && "))


@pytest.mark.parametrize("paper", PAPERS, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_what_a_paper_names_exists(paper):
    text = paper.read_text("utf-8")
    assert not missing_files(paper, text)
    assert not missing_commands(text)
    assert not outside(text)


def test_the_citation_is_of_this_version():
    assert f"\nversion: {__version__}\n" in (ROOT / "CITATION.cff").read_text("utf-8")


def test_the_checks_tell_right_from_wrong():
    assert blocks("a\n```python\nx = 1\n```\n\n    y\n```bash\nz\n```\n```python\nw\n```\n") == ["x = 1\n", "w\n"]
    assert missing_files(CARD, "[a](gone.md) ![b](README.md) `rein3d_jax/gone.py` `rein3d_jax/scene.py` `runs/a/`") == [
        "gone.md",
        "rein3d_jax/gone.py",
    ]
    assert missing_commands("python -m experiments.gone; rein3d view x; rein3d go") == [
        "experiments go",
        "experiments gone",
    ]
    assert outside("as ../shared/rooms has\nfine\n(issue 3)") == ["as ../shared/rooms has", "(issue 3)"]
