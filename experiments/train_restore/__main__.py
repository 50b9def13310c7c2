"""Train a restoration network, the small one or the full-size one: the recipe's `model` says which.

    python -m experiments.train_restore --config experiments/recipes/tiny_train.toml [--set key=value ...] [--resume]
        [--address HOST:PORT --processes N --process I]

The output folder then holds the weights that `--set restore.weights=` of the main job takes.
"""

import argparse
import sys

from experiments.command import CommandParser
from experiments.config import load_config, read_recipe
from experiments.train_restore.learned.config import LearnedTrainConfig
from experiments.train_restore.learned.train import train_learned
from experiments.train_restore.wan.config import WanTrainConfig
from experiments.train_restore.wan.train import train_wan
from rein3d_jax.errors import InputError
from rein3d_jax.parallel import join_hosts, tethered

MODELS = {"learned": (LearnedTrainConfig, train_learned), "diffusion": (WanTrainConfig, train_wan)}  # as restore.method


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0, or 2 with one line on stderr where the input is at fault."""
    parser = CommandParser("train_restore", __doc__)
    parser.add_recipe(LearnedTrainConfig, WanTrainConfig, example="tiny_train")
    parser.add_argument("--resume", action="store_true", help="go on after the output folder's last checkpoint")
    parser.add_argument("--address", metavar="HOST:PORT", help="of process 0, where several hosts train as one")
    parser.add_argument("--processes", type=int, metavar="N", help="how many hosts")
    parser.add_argument("--process", type=int, metavar="I", help="this host's number, from 0")
    return parser.run(_train, arguments)


def _train(options: argparse.Namespace) -> None:
    model = read_recipe(options.config).get("model")
    if model not in MODELS:
        raise InputError(f'{options.config}: model "{model}" is unknown; choose one of {", ".join(MODELS)}')
    kind, train = MODELS[model]
    config = load_config(kind, options.config, options.set)
    join_hosts(options.address, options.processes, options.process)
    with tethered(options.address, _say):
        train(config, resume=options.resume)


def _say(line: str) -> None:
    print(f"train_restore: {line}", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
