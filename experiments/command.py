"""What all commands share: a parser that names them, --config, --set and --keys, the compile cache, and exit code 2
with one line on stderr where the input is at fault."""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

from experiments.compile_cache import use_compile_cache
from experiments.keys import keys_text
from rein3d_jax.errors import InputError


class CommandParser(argparse.ArgumentParser):
    """The arguments of the command `name`, whose module's docstring is `doc`.

    def main(arguments: list[str] | None = None) -> int:
        parser = CommandParser("export", __doc__)
        parser.add_argument(...)
        return parser.run(_export, arguments)
    """

    def __init__(self, name: str, doc: str, package: str = "experiments"):
        console = Path(sys.argv[0]).stem == "rein3d"
        super().__init__(prog=f"rein3d {name}" if console else f"python -m {package}.{name}", description=_first(doc))
        self.command, self.package = name, package

    def add_recipe(self, *configs: type, default: str | None = None, example: str = "quick") -> None:
        """--config, required unless there is a `default`, --set, and --keys, which prints the keys of `configs`."""
        recipe = f"a recipe's file, or the name of a packaged one, such as {example}"
        recipe += f" (default: {default})" if default else ""
        self.add_argument("--config", metavar="RECIPE", required=default is None, default=default, help=recipe)
        self.add_argument("--set", metavar="KEY=VALUE", action="append", default=[], help="change a key of the recipe")
        self.add_argument("--keys", action=_PrintKeys, nargs=0, configs=configs, help="print all keys of the recipe")

    def run(self, work: Callable[[argparse.Namespace], int | None], arguments: list[str] | None = None) -> int:
        """The exit code of `work` with the parsed arguments: 0 for None, 2 with a line on stderr for an InputError."""
        options = self.parse_args(arguments)
        if self.package == "experiments":  # benchmarks measure compilation too
            use_compile_cache()
        try:
            return work(options) or 0
        except InputError as error:
            print(f"{self.command}: {error}", file=sys.stderr)
            return 2


class _PrintKeys(argparse.Action):
    """As --help: prints and leaves."""

    def __init__(self, *, configs: tuple[type, ...], **known):
        super().__init__(**known)
        self.configs = configs

    def __call__(self, parser, *_) -> None:
        print("\n".join(map(keys_text, self.configs)), end="")
        parser.exit(0)


def _first(doc: str) -> str:
    return doc.partition("\n")[0]
