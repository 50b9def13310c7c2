"""python -m benchmarks rasterize | refine_step | scaling | poles [--json FILE]"""

import argparse
import sys

from benchmarks import poles, rasterize, refine_step, scaling
from benchmarks.engines.worker import ENGINES
from benchmarks.workloads import SIZES
from rein3d_jax.errors import InputError


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0, or 2 with one line on stderr where an argument is at fault."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description="Side-by-side measurements.")
    commands = parser.add_subparsers(dest="command", required=True)
    for module in (rasterize, refine_step, scaling, poles):
        command = commands.add_parser(module.__name__.split(".")[-1], help=module.__doc__.splitlines()[0])
        command.add_argument("--json", metavar="FILE", help="write the numbers there")
        command.set_defaults(main=module.main)
        if module in (rasterize, refine_step):
            command.add_argument("--workloads", default=",".join(SIZES), help="of A,B,C (default: all)")
            command.add_argument("--rounds", type=int, default=5)
        if module is rasterize:
            command.add_argument("--engines", default=",".join(ENGINES), help=f"of {', '.join(ENGINES)} (default: all)")
        if module is poles:
            command.add_argument("--chart", metavar="FILE", help="draw the errors there (PNG)")
    options = parser.parse_args(arguments)
    try:
        return options.main(options)
    except InputError as error:
        print(f"benchmarks: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
