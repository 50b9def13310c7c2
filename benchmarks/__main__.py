"""The measurements, a line each. `python -m benchmarks NAME ...` is `python -m benchmarks.NAME ...`."""

import sys

from experiments.command_list import run_listed


def main(arguments: list[str] | None = None) -> int:
    """The measurement's exit code; 0 for their list, 2 for an unknown one."""
    return run_listed("benchmarks", arguments)


if __name__ == "__main__":
    sys.exit(main())
