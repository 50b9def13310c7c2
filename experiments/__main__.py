"""The commands, a line each: by `rein3d`. `rein3d NAME ...` is `python -m experiments.NAME ...`."""

import sys

from experiments.command_list import run_listed


def main(arguments: list[str] | None = None) -> int:
    """The command's exit code; 0 for the list of commands, 2 for an unknown one."""
    return run_listed("experiments", arguments)


if __name__ == "__main__":
    sys.exit(main())
