"""Train the network that estimates a panorama's distance, on drawn and rendered rooms.

python -m experiments.train_depth --config train_depth [--set key=value ...] [--resume]
"""

import argparse
import sys

from experiments.command import CommandParser
from experiments.config import load_config
from experiments.train_depth.config import DepthTrainConfig
from experiments.train_depth.train import train_depth


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0, or 2 with one line on stderr where the input is at fault."""
    parser = CommandParser("train_depth", __doc__)
    parser.add_recipe(DepthTrainConfig, example="train_depth")
    parser.add_argument("--resume", action="store_true", help="go on after the output folder's last checkpoint")
    return parser.run(_train, arguments)


def _train(options: argparse.Namespace) -> None:
    train_depth(load_config(DepthTrainConfig, options.config, options.set), resume=options.resume)


if __name__ == "__main__":
    sys.exit(main())
