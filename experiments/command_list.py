"""The commands of a folder of code: a line each, without importing them, and run by name."""

import ast
import difflib
import importlib
import sys
from pathlib import Path


def commands(folder: Path) -> dict[str, str]:
    """{name: first line of its docstring} of the modules below `folder` that define `main`; that of NAME/__main__.py
    is NAME."""
    found = {}
    for path in sorted(folder.rglob("*.py")):
        name = ".".join(path.relative_to(folder).with_suffix("").parts).removesuffix("__main__").removesuffix(".")
        source = path.read_text("utf-8") if name else ""
        if "\ndef main(" in source:
            found[name] = (ast.get_docstring(ast.parse(source)) or "").partition("\n")[0]
    return found


def run_listed(package: str, arguments: list[str] | None = None) -> int:
    """Runs `NAME ...` of the commands in `package`; without a name prints their list. The command's exit code, 0 for
    the list, 2 for an unknown name."""
    name, *rest = (sys.argv[1:] if arguments is None else arguments) or [""]
    folder = Path(importlib.import_module(package).__file__).parent
    known = commands(folder)
    if name in known:
        inner = ".__main__" if folder.joinpath(*name.split("."), "__main__.py").exists() else ""
        return importlib.import_module(f"{package}.{name}{inner}").main(rest) or 0
    if name in ("", "-h", "--help"):
        width = max(map(len, known))
        print("\n".join(f"{command:{width}}  {line}" for command, line in known.items()))
        return 0
    (closest,) = difflib.get_close_matches(name, known, n=1, cutoff=0.0)
    print(f"{package}: {name} is no command; did you mean {closest}?", file=sys.stderr)
    return 2
