"""Every config says what its settings mean and refuses what they may not be, by name."""

import ast
import dataclasses
import importlib
import math
from pathlib import Path

import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.settings import Settings, meaning_of

ROOT = Path(__file__).resolve().parents[1]
IN_BLENDER = "blender"  # runs in a Python of its own


def config_classes() -> list[type]:
    """All classes named ...Config of the package and the commands."""
    found = []
    for path in sorted(file for top in ("rein3d_jax", "experiments") for file in (ROOT / top).rglob("*.py")):
        names = [node.name for node in ast.parse(path.read_text("utf-8")).body if isinstance(node, ast.ClassDef)]
        names = [name for name in names if name.endswith("Config")]
        if names and IN_BLENDER not in path.parts:
            module = importlib.import_module(".".join(path.relative_to(ROOT).with_suffix("").parts))
            found += [getattr(module, name) for name in names]
    return found


def leaves(cls: type) -> list[dataclasses.Field]:
    return [field for field in dataclasses.fields(cls) if not dataclasses.is_dataclass(field.default)]


def outside(interval: str) -> list[float]:
    """Numbers that an interval does not hold, next to its ends and none at all."""
    low, high = (float(end) for end in interval[1:-1].split(","))
    below = low if interval[0] == "(" else low - 1
    above = high if interval[-1] == ")" else high + 1
    return [below, math.nan] if interval.endswith("inf]") else [below, above, math.nan]


@pytest.mark.parametrize("cls", config_classes(), ids=lambda cls: cls.__name__)
def test_every_setting_is_documented_and_checked(cls):
    assert issubclass(cls, Settings)
    for field in leaves(cls):
        meaning = meaning_of(field)
        assert meaning is not None and meaning.text, f"{cls.__name__}.{field.name} does not say what it means"
        numbers = field.default if isinstance(field.default, tuple) else (field.default,)
        if any(type(number) in (int, float) for number in numbers):
            assert meaning.limits, f"{cls.__name__}.{field.name} takes any number"
        if meaning.within:
            for wrong in outside(meaning.within):
                value = (wrong,) * len(numbers) if isinstance(field.default, tuple) else wrong
                with pytest.raises(InputError, match=field.name):
                    dataclasses.replace(cls(), **{field.name: value})
