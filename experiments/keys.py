"""Every key of every recipe, as Markdown: its default, unit, range and meaning.

    python -m experiments.keys [--into experiments/README.md]

--into puts the text between the file's marks, where a test expects it.
"""

import argparse
import dataclasses
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from experiments.config import toml_value
from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.settings import Meaning, meaning_of

MARKS = ("<!-- keys: begin -->\n", "<!-- keys: end -->\n")


class _Table(NamedTuple):
    """A table of a recipe: its dotted name ("" = the recipe's own keys), its config, its leaves."""

    name: str
    config: Any
    leaves: list[tuple[str, str, Meaning]]  # key, default as TOML, meaning


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0, or 2 where the file has no marks."""
    parser = argparse.ArgumentParser(prog="python -m experiments.keys", description=__doc__.partition("\n")[0])
    parser.add_argument("--into", metavar="FILE", type=Path, help="a Markdown file with the two marks")
    options = parser.parse_args(arguments)
    if options.into is None:
        print(keys_markdown())
        return 0
    try:
        write_text(options.into, with_keys(options.into.read_text("utf-8")))
    except InputError as error:
        print(f"keys: {options.into}: {error}", file=sys.stderr)
        return 2
    return 0


def keys_text(cls: type) -> str:
    """What --keys prints of a recipe that is a `cls`: a line a key, by tables."""
    lines = []
    for table in _tables(cls(), ""):
        lines += [f"[{table.name}]" if table.name else cls.__name__, f"# {_first_line(table.config)}"]
        lines += [f"{key} = {default}{_remark(meaning)}" for key, default, meaning in table.leaves] + [""]
    return "\n".join(lines)


def keys_markdown() -> str:
    """The same of all commands' recipes. Of a config that stood already, only what differs."""
    lines, seen = [], {}
    for command, classes in _recipes().items():
        for cls in classes:
            which = f", `model = {toml_value(cls.model)}`" if len(classes) > 1 else ""
            lines += [f"### {command}{which}", ""]
            for table in _tables(cls(), ""):
                lines += [*_markdown(command, table, seen), ""]
    return "\n".join(lines)


def with_keys(text: str) -> str:
    """The Markdown `text` with all keys between its marks. Raises InputError where it has none."""
    begin, end = MARKS
    if begin not in text or end not in text.partition(begin)[2]:
        raise InputError(f"needs the lines {begin.strip()} and {end.strip()}")
    before, _, rest = text.partition(begin)
    return before + begin + "\n" + keys_markdown() + end + rest.partition(end)[2]


def _recipes() -> dict[str, tuple[type, ...]]:
    from experiments.build_dataset.dataset import DatasetConfig
    from experiments.build_examples.example import ExamplesConfig
    from experiments.reconstruct.config import ReconstructConfig
    from experiments.train_depth.config import DepthTrainConfig
    from experiments.train_restore.learned.config import LearnedTrainConfig
    from experiments.train_restore.wan.config import WanTrainConfig

    return {
        "reconstruct": (ReconstructConfig,),
        "train_restore": (LearnedTrainConfig, WanTrainConfig),
        "train_depth": (DepthTrainConfig,),
        "build_examples": (ExamplesConfig,),
        "build_dataset": (DatasetConfig,),
    }


def _tables(config: Any, name: str) -> Iterator[_Table]:
    leaves, inner = [], []
    for field in dataclasses.fields(config):
        value = getattr(config, field.name)
        if dataclasses.is_dataclass(value):
            inner.append((f"{name}.{field.name}".lstrip("."), value))
        else:
            leaves.append((field.name, toml_value(value), meaning_of(field) or Meaning("")))
    yield _Table(name, config, leaves)
    for below, value in inner:
        yield from _tables(value, below)


def _markdown(command: str, table: _Table, seen: dict[type, tuple[str, _Table]]) -> list[str]:
    title = f"`[{table.name}]`" if table.name else "The recipe"
    if type(table.config) in seen:
        where, first = seen[type(table.config)]
        changed = [f"`{x[0]} = {x[1]}`" for x, y in zip(table.leaves, first.leaves, strict=True) if x != y]
        but = f", but {', '.join(changed)}" if changed else ""
        return [f"{title}: as `[{first.name}]` of {where}{but}."]
    seen[type(table.config)] = command, table
    cells = [(f"`{key}`", f"`{default}`", m.unit, m.limits, m.text) for key, default, m in table.leaves]
    rows = [f"| {' | '.join(cell.replace('|', '&#124;') for cell in row)} |" for row in cells]
    head = ["", "| key | default | unit | must be | meaning |", "|---|---|---|---|---|"] if rows else []
    return [f"{title}: {_first_line(table.config)}", *head, *rows]


def _first_line(config: Any) -> str:
    return (type(config).__doc__ or "").partition("\n")[0]


def _remark(meaning: Meaning) -> str:
    words = ", ".join(filter(None, [meaning.text, meaning.unit]))
    limits = f" ({meaning.limits})" if meaning.limits else ""
    return f"  # {words}{limits}" if words or limits else ""


if __name__ == "__main__":
    sys.exit(main())
