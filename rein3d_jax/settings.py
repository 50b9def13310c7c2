"""Settings: fields of a config that say what they mean, in which unit, and what they may be.

    @dataclass(frozen=True)
    class LiftConfig(Settings):
        "How a panorama becomes Gaussians."

        opacity: float = setting(0.99, "of every Gaussian", within="(0, 1)")

The same words serve the reader of the code, the check of a value, and `--keys` of every command."""

import dataclasses
import math
from typing import Any

from rein3d_jax.errors import InputError

_MEANING = "rein3d_jax.setting"  # the key under which a field's metadata holds its Meaning


@dataclasses.dataclass(frozen=True)
class Meaning:
    """What is to be known of a setting besides its name, type and default."""

    text: str
    within: str = ""  # an interval such as "[1, inf)"; "" = anything
    among: tuple[str, ...] = ()  # the words that it may be
    unit: str = ""

    def allows(self, value: Any) -> bool:
        """Whether `value` may be: each item of a tuple counts for itself, None (a setting left out) always may."""
        if isinstance(value, tuple):
            return all(self.allows(item) for item in value)
        if value is None:
            return True
        if self.among:
            return value in self.among
        return not self.within or _inside(self.within, value)

    @property
    def limits(self) -> str:
        """The allowed values in words: `in [1, inf)`, `one of default, mcmc`, or nothing."""
        return f"one of {', '.join(self.among)}" if self.among else f"in {self.within}" if self.within else ""


def setting(default: Any, text: str, *, within: str = "", among: tuple[str, ...] = (), unit: str = "") -> Any:
    """A dataclass field with its meaning: what it is (`text`), its interval or its words, its unit."""
    return dataclasses.field(default=default, metadata={_MEANING: Meaning(text, within, among, unit)})


def meaning_of(field: dataclasses.Field) -> Meaning | None:
    """What `setting` said of a field; None where it is a plain one."""
    return field.metadata.get(_MEANING)


@dataclasses.dataclass(frozen=True)
class Settings:
    """A config: its settings are checked when it is made. Raises InputError("NAME must be ..., not ...").

    One that also checks settings against each other calls super().__post_init__() first."""

    def __post_init__(self):
        for field in dataclasses.fields(self):
            meaning, value = meaning_of(field), getattr(self, field.name)
            if meaning is not None and not meaning.allows(value):
                raise InputError(f"{field.name} must be {meaning.limits}, not {_shown(value)}")


def _shown(value: Any) -> str:
    return f'"{value}"' if isinstance(value, str) else str(value)


def _inside(interval: str, value: float) -> bool:
    low, high = (float(end) for end in interval[1:-1].split(","))
    above = value > low or (value == low and interval[0] == "[")
    below = value < high or (value == high and interval[-1] == "]")
    return above and below and not math.isnan(value)
