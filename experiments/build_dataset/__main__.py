"""Build a dataset of clean and degraded clips to train a restorer on (Rein3D, Sec. 3).

    python -m experiments.build_dataset --config tiny_pairs [--set key=value ...]
        [--worker I/N | --ray N [--ray-address A] | --address HOST:PORT --processes N --process I] [--check]

Writes ArrayRecord shards, a JSON beside each, config.toml and manifest.json. Run again after a kill it goes on;
a damaged shard is named and built again. However many workers, the bytes are the same. --check only looks.
"""

import argparse
import sys

import jax

from experiments.build_dataset.dataset import DatasetConfig, build_part
from experiments.build_dataset.ray_workers import build_with_ray
from experiments.command import CommandParser
from experiments.config import load_config
from rein3d_jax.errors import InputError
from rein3d_jax.io.pairs.pair_shard import PairDataset
from rein3d_jax.parallel import join_hosts


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0, or 2 with a line on stderr for each thing that is at fault."""
    parser = CommandParser("build_dataset", __doc__)
    parser.add_recipe(DatasetConfig, example="tiny_pairs")
    parser.add_argument("--check", action="store_true", help="build nothing: name the damaged shards")
    workers = parser.add_mutually_exclusive_group()
    workers.add_argument("--worker", metavar="I/N", help="build only the share of worker I, from 0, of N")
    workers.add_argument("--ray", metavar="N", type=int, help="build with N Ray workers")
    workers.add_argument("--address", metavar="HOST:PORT", help="of process 0 of a jax.distributed run")
    parser.add_argument("--ray-address", metavar="A", help="of a Ray cluster; without it one is started here")
    parser.add_argument("--processes", type=int, metavar="N", help="with --address: how many there are")
    parser.add_argument("--process", type=int, metavar="I", help="with --address: this one's number, from 0")
    return parser.run(_build, arguments)


def _build(options: argparse.Namespace) -> None:
    config = load_config(DatasetConfig, options.config, options.set)
    if options.check:
        if faults := PairDataset(config.output).faults():
            raise InputError("; ".join(faults))
        print(f"{config.output}: every shard has its checksum")
    elif options.ray is not None:
        if options.ray < 1:
            raise InputError(f"--ray {options.ray}: at least 1 worker is needed")
        build_with_ray(config, options.ray, options.ray_address)
    else:
        join_hosts(options.address, options.processes, options.process)
        share = _share(options.worker) if options.worker else (jax.process_index(), jax.process_count())
        build_part(config, *share, say=lambda line: print(line, flush=True))


def _share(text: str) -> tuple[int, int]:
    index, slash, count = text.partition("/")
    if not (slash and index.isdigit() and count.isdigit() and int(index) < int(count)):
        raise InputError(f"--worker {text}: write it as I/N, I from 0 to N - 1")
    return int(index), int(count)


if __name__ == "__main__":
    sys.exit(main())
