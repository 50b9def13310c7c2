"""Weights of an untrained diffusion network, for trying out what handles weights: jobs, memory, other loaders.

    python -m experiments.random_weights --config paper_small --output runs/wan_small/weights [--layout wan]
        [--set restore.diffusion.network.dit.param_dtype=bfloat16 ...]

The sizes and types are the recipe's [restore.diffusion.network]. The folder is one that restore.weights takes, and
embedded prompts of zeros are in it.
"""

import argparse
import sys
from pathlib import Path

from experiments.command import CommandParser
from experiments.config import load_config
from experiments.reconstruct.config import ReconstructConfig
from rein3d_jax.errors import InputError
from rein3d_jax.networks.wan import random_wan, write_wan
from rein3d_jax.restore.wan.names import LAYOUTS


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0, or 2 with one line on stderr where the input is at fault."""
    parser = CommandParser("random_weights", __doc__)
    parser.add_recipe(ReconstructConfig, default="paper_small")
    parser.add_argument("--output", metavar="FOLDER", required=True, help="where to write")
    parser.add_argument("--layout", choices=LAYOUTS, default="diffusers", help="whose names the tensors have")
    return parser.run(_write, arguments)


def _write(options: argparse.Namespace) -> None:
    config, folder = load_config(ReconstructConfig, options.config, options.set), Path(options.output)
    if (folder / "transformer").exists():
        raise InputError(f"{folder} holds a transformer already: choose another --output")
    network = config.restore.diffusion.network
    write_wan(folder, random_wan(config.seed, network), network, layout=options.layout)
    size = sum(file.stat().st_size for file in folder.rglob("*.safetensors"))
    print(f"wrote {folder}, {size / 1e6:,.1f} MB")


if __name__ == "__main__":
    sys.exit(main())
