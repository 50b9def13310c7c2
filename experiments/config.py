"""Recipes: TOML to nested frozen dataclasses and back. What is unknown or of the wrong type is refused by its dotted
name; the result is hashable, so that each stage's part can be a static argument of jit.

A field is an int, float, bool, str, a tuple of those, one of those `| None` (written "none"), or another config.
A config checks itself when it is made (settings.py): it raises InputError("steps must ...") and comes out of here
as "refine.steps must ..."."""

import dataclasses
import difflib
import hashlib
import json
import math
import reprlib
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

from rein3d_jax.errors import InputError

Config = TypeVar("Config")

RECIPES = Path(__file__).parent / "recipes"
NONE = "none"  # TOML has no null
KINDS = {int: "a whole number", float: "a number", bool: "true or false", str: "text in quotes"}


def load_config(cls: type[Config], recipe: str | Path, overrides: Sequence[str] = ()) -> Config:
    """A `cls` of the `recipe`, as read_recipe finds it, each override "stage.key=value" laid over it in turn.

    Raises InputError for a file that cannot be read, for an unknown or missing key, a wrong type, a failed check."""
    return config_from(cls, read_recipe(recipe), overrides)


def config_from(cls: type[Config], table: Mapping, overrides: Sequence[str] = ()) -> Config:
    """The same of a table."""
    return _laid_over(cls, table, overrides, None)


def changed(config: Config, overrides: Sequence[str]) -> Config:
    """The config with each override "stage.key=value" laid over it in turn. Raises InputError as load_config does."""
    return _laid_over(type(config), {}, overrides, config)


def _laid_over(cls: type[Config], table: Mapping, overrides: Sequence[str], base: Config | None) -> Config:
    for override in overrides:
        table = _merge(table, _override(override))
    _refuse_unknown(cls, table, "", list(_known_keys(cls)))
    return _build(cls, table, "", base)


def dump_config(config: Any) -> str:
    """TOML text that `load_config` reads back equal."""
    return "\n".join(_tables(config, "")).lstrip("\n") + "\n"


def recipe_path(name: str | Path) -> Path:
    """The file `name`, or the packaged recipe of that name, with or without .toml. Raises InputError for neither."""
    path = Path(name)
    packaged = {recipe.stem: recipe for recipe in sorted(RECIPES.glob("*.toml"))}
    if path.is_file() or path.parent != Path():
        return path
    if (stem := path.name.removesuffix(".toml")) not in packaged:
        raise InputError(f"{name} is no file, and no packaged recipe; those are {', '.join(packaged)}; check --config")
    return packaged[stem]


def read_recipe(name: str | Path) -> dict:
    """The table of a recipe's file, or of the packaged recipe `name`. Raises InputError where it cannot be read."""
    path = recipe_path(name)
    try:
        return tomllib.loads(path.read_text("utf-8-sig"))
    except OSError as error:
        raise InputError(f"{path}: the recipe cannot be read ({error.strerror}); check --config") from error
    except ValueError as error:  # TOML at fault (the message ends with the line), or not UTF-8
        raise InputError(f"{path}: not a TOML recipe: {error}") from error


def recipe_digest(path: Path) -> str:
    """What tells a result's recipe from another: the hash of its file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _override(text: str) -> dict:
    key, equals, value = text.partition("=")
    if not (equals and key.strip()):
        raise InputError(f"--set {text}: write it as stage.key=value")
    nested: Any = _override_value(value.strip())
    for name in reversed(key.strip().split(".")):
        nested = {name: nested}
    return nested


def _override_value(text: str) -> Any:
    """A TOML value, or the text itself: a bare word needs no quotes on a command line."""
    try:
        parsed = tomllib.loads(f"value = {text}")
    except ValueError:
        return text
    return parsed["value"] if len(parsed) == 1 else text  # a line break in `text` could smuggle in other keys


def _merge(below: Any, above: Any) -> Any:
    if not (isinstance(below, Mapping) and isinstance(above, Mapping)):
        return above
    return {**below, **{key: _merge(below.get(key), value) for key, value in above.items()}}


def _known_keys(cls: type, prefix: str = "") -> Iterator[str]:
    for name, kind in get_type_hints(cls).items():
        yield prefix + name
        if dataclasses.is_dataclass(kind):
            yield from _known_keys(kind, f"{prefix}{name}.")


def _refuse_unknown(cls: type, table: Mapping, prefix: str, known: list[str]) -> None:
    kinds = get_type_hints(cls)
    for name, value in table.items():
        if name not in kinds:
            moved = [key for key in known if key.rpartition(".")[2] == name]  # to another table
            (closest,) = difflib.get_close_matches(prefix + name, moved or known, n=1, cutoff=0.0)
            raise InputError(f"{prefix}{name} is not a setting; did you mean {closest}?")
        if dataclasses.is_dataclass(kinds[name]) and isinstance(value, Mapping):
            _refuse_unknown(kinds[name], value, f"{prefix}{name}.", known)


def _build(cls: type[Config], table: Mapping, prefix: str, base: Config | None = None) -> Config:
    """A `cls` of `table`; what the table leaves out is taken from `base`, or else from the class's defaults."""
    kinds, values = get_type_hints(cls), {}
    for field in dataclasses.fields(cls):
        name, default = field.name, _default(field) if base is None else getattr(base, field.name)
        if name in table:
            values[name] = _value(kinds[name], table[name], prefix + name, default)
        elif default is dataclasses.MISSING:
            raise InputError(f"{prefix}{name} is missing: give it in the recipe or with --set {prefix}{name}=...")
    try:
        return cls(**values) if base is None else dataclasses.replace(base, **values)
    except InputError as error:
        message = str(error)
        raise InputError(message if message.startswith(prefix) else prefix + message) from error


def _default(field: dataclasses.Field) -> Any:
    return field.default if field.default_factory is dataclasses.MISSING else field.default_factory()


def _value(kind: Any, value: Any, key: str, default: Any = dataclasses.MISSING) -> Any:
    """`value` as a `kind`: a list becomes a tuple, a whole number will do for a number; a bool never does."""
    if get_origin(kind) in (Union, UnionType) and value == NONE:
        return None
    inner = _inner(kind)
    if dataclasses.is_dataclass(inner) and isinstance(value, Mapping):
        return _build(inner, value, f"{key}.", None if default is dataclasses.MISSING else default)
    if get_origin(inner) is tuple and isinstance(value, list):
        items = get_args(inner)
        kinds = items[:1] * len(value) if items[-1] is Ellipsis else items
        if len(kinds) == len(value):
            return tuple(_value(k, v, f"{key}[{i}]") for i, (k, v) in enumerate(zip(kinds, value, strict=True)))
    if inner is float and type(value) in (int, float) and not math.isnan(value):
        return float(value)
    if inner in (int, bool, str) and type(value) is inner:
        return value
    raise InputError(f"{key} must be {_describe(kind)}, not {reprlib.repr(value)}")


def _inner(kind: Any) -> Any:
    """X of `X | None`; any other kind as it is."""
    if get_origin(kind) not in (Union, UnionType):
        return kind
    (inner,) = (arm for arm in get_args(kind) if arm is not NoneType)
    return inner


def _describe(kind: Any) -> str:
    if kind in KINDS:
        return KINDS[kind]
    if dataclasses.is_dataclass(kind):
        return "a table of settings"
    if get_origin(kind) is tuple:
        return f"a list [{', '.join('...' if item is Ellipsis else _describe(item) for item in get_args(kind))}]"
    return f'{_describe(_inner(kind))}, or "{NONE}"'


def _tables(config: Any, prefix: str) -> Iterator[str]:
    """The lines of a table: its values first, as TOML wants, then the tables inside it."""
    values = {field.name: getattr(config, field.name) for field in dataclasses.fields(config)}
    inner = {name: value for name, value in values.items() if dataclasses.is_dataclass(value)}
    yield from (f"{name} = {toml_value(value)}" for name, value in values.items() if name not in inner)
    for name, value in inner.items():
        yield from (f"\n[{prefix}{name}]", *_tables(value, f"{prefix}{name}."))


def toml_value(value: Any) -> str:
    """The TOML text of a recipe's value."""
    if value is None:
        return f'"{NONE}"'
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):  # TOML's escapes are JSON's, but for DEL
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, tuple):
        return f"[{', '.join(map(toml_value, value))}]"
    return repr(value)
