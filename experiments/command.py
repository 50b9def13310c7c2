"""What all commands share: a parser that names them, --config, --set and --keys, the compile cache, and one line on
stderr where the input is at fault or the machine (exit code 2), or where Ctrl-C ended it (130)."""

import argparse
import io
import sys
from collections.abc import Callable
from pathlib import Path

from experiments.compile_cache import use_compile_cache
from experiments.interrupt import INTERRUPTED, ends_soon
from experiments.keys import keys_text
from experiments.machine import machine_fault, require_float32
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
        self.lighter = "free some, or take a machine with more"  # the mend where memory does not suffice

    def add_recipe(self, *configs: type, default: str | None = None, example: str = "quick") -> None:
        """--config, required unless there is a `default`, --set, and --keys, which prints the keys of `configs`."""
        recipe = f"a recipe's file, or the name of a packaged one, such as {example}"
        recipe += f" (default: {default})" if default else ""
        self.add_argument("--config", metavar="RECIPE", required=default is None, default=default, help=recipe)
        self.add_argument("--set", metavar="KEY=VALUE", action="append", default=[], help="change a key of the recipe")
        self.add_argument("--keys", action=_PrintKeys, nargs=0, configs=configs, help="print all keys of the recipe")

    def run(self, work: Callable[[argparse.Namespace], int | None], arguments: list[str] | None = None) -> int:
        """The exit code of `work` with the parsed arguments: 0 for None; with a line on stderr 2 for an InputError or a
        machine's fault, 130 for Ctrl-C. Other errors are bugs, and rise."""
        _print_any_name()
        options = self.parse_args(arguments)
        again = f"interrupted: run the same command {self._with_resume()}to go on"
        try:
            with ends_soon(f"{self.command}: {again}"):
                require_float32()
                if self.package == "experiments":  # benchmarks measure compilation too
                    use_compile_cache()
                return work(options) or 0
        except KeyboardInterrupt:
            return self._end(again, INTERRUPTED)
        except InputError as error:
            return self._end(str(error), 2)
        except Exception as error:
            if (fault := machine_fault(error, self.lighter)) is None:
                raise
            return self._end(fault, 2)

    def _with_resume(self) -> str:
        return "with --resume " if "--resume" in self._option_string_actions else "again "

    def _end(self, line: str, code: int) -> int:
        print(f"{self.command}: {line}", file=sys.stderr)
        return code


class _PrintKeys(argparse.Action):
    """As --help: prints and leaves."""

    def __init__(self, *, configs: tuple[type, ...], **known):
        super().__init__(**known)
        self.configs = configs

    def __call__(self, parser, *_) -> None:
        print("\n".join(map(keys_text, self.configs)), end="")
        parser.exit(0)


def _print_any_name() -> None:
    """Lets stdout escape what its encoding lacks, as stderr does: a folder's name is no reason to fail."""
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors == "strict":
        sys.stdout.reconfigure(errors="backslashreplace")


def _first(doc: str) -> str:
    return doc.partition("\n")[0]
