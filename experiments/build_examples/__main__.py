"""Make the training examples of the learned restorer: clips through drawn rooms, degraded and filled.

    python -m experiments.build_examples --config experiments/recipes/tiny_examples.toml [--set key=value ...]

Example i is a function of the seed and i. Killed and begun again, it goes on; a folder may be trained on while it is
being written.
"""

import argparse
import sys
from functools import partial

from experiments.build_examples.example import ExamplesConfig, example
from experiments.command import CommandParser
from experiments.config import load_config
from experiments.example_store import write_examples


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0, or 2 with one line on stderr where the input is at fault."""
    parser = CommandParser("build_examples", __doc__)
    parser.add_recipe(ExamplesConfig, example="tiny_examples")
    return parser.run(_build, arguments)


def _build(options: argparse.Namespace) -> None:
    config = load_config(ExamplesConfig, options.config, options.set)
    for done in write_examples(config.output, partial(example, config=config), config.count):
        if done % 20 == 0 or done == config.count:
            print(f"{done}/{config.count} examples", flush=True)


if __name__ == "__main__":
    sys.exit(main())
