"""Train a restoration network: the small one (train_learned.py) or the full-size one (train_wan.py), as the recipe's
`model` says.

    python -m experiments.train_restore --config experiments/recipes/tiny_train.toml [--set key=value ...] [--resume]
        [--address HOST:PORT --processes N --process I]

The output folder then holds the weights that `--set restore.weights=` of the main job takes.
"""

import argparse
import sys

from experiments.compile_cache import use_compile_cache
from experiments.config import load_config, read_recipe
from experiments.train_restore.config import TrainConfig
from experiments.train_restore.learned import train as train_learned
from experiments.train_restore.wan import train as train_wan
from experiments.train_restore.wan_config import WanTrainConfig
from rein3d_jax.errors import InputError
from rein3d_jax.parallel import join_hosts

MODELS = {"learned": (TrainConfig, train_learned), "diffusion": (WanTrainConfig, train_wan)}  # as restore.method


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0, or 2 with one line on stderr where the input is at fault."""
    options = _parser().parse_args(arguments)
    use_compile_cache()
    try:
        model = read_recipe(options.config).get("model")
        if model not in MODELS:
            raise InputError(f'{options.config}: model "{model}" is unknown; choose one of {", ".join(MODELS)}')
        kind, train = MODELS[model]
        config = load_config(kind, options.config, options.set)
        join_hosts(options.address, options.processes, options.process)
        train(config, resume=options.resume)
    except InputError as error:
        print(f"train_restore: {error}", file=sys.stderr)
        return 2
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m experiments.train_restore", description=__doc__.splitlines()[0])
    parser.add_argument("--config", required=True, help="a recipe, such as experiments/recipes/tiny_train.toml")
    parser.add_argument("--set", metavar="KEY=VALUE", action="append", default=[], help="change one key of the recipe")
    parser.add_argument("--resume", action="store_true", help="go on after the output folder's last checkpoint")
    parser.add_argument("--address", metavar="HOST:PORT", help="of process 0, where several hosts train as one")
    parser.add_argument("--processes", type=int, metavar="N", help="how many hosts")
    parser.add_argument("--process", type=int, metavar="I", help="this host's number, from 0")
    return parser


if __name__ == "__main__":
    sys.exit(main())
