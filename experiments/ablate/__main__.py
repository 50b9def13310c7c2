"""Train the learned restorer in several variants, each with several seeds, and compare what they restore.

    python -m experiments.ablate --config experiments/recipes/ablate_restorer.toml --json FILE [--picture PNG]
        [--set key=value ...]

The recipe is that of experiments.train_restore, and a table more:

    [ablation]
    seeds = [0, 1, 2]
    sampler_steps = [1, 4]                     # each run is scored after so many sampler steps
    [ablation.variants]
    full = []
    no_anchor = ["network.anchor=false"]       # what differs, as --set takes it

Runs go into folders of `output`, one a variant and seed; finished ones are not run again.
"""

import argparse
import dataclasses
import json
import sys
from pathlib import Path
from time import perf_counter

import jax
import numpy as np

from experiments.ablate.chart import ablation_chart
from experiments.command import CommandParser
from experiments.config import config_from, read_recipe
from experiments.example_store import ExampleStore
from experiments.train_restore.learned.config import LearnedTrainConfig
from experiments.train_restore.learned.held_out import restored_colours, score_held_out
from experiments.train_restore.learned.train import train_learned
from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.io.files.json_file import read_json
from rein3d_jax.io.weights.restorer_weights import read_restorer
from rein3d_jax.restore.learned.sample import Learned

_TIMED = 5  # clips


@dataclasses.dataclass(frozen=True)
class Ablation:
    """Table [ablation] of a recipe."""

    variants: dict[str, list[str]]
    seeds: tuple[int, ...] = (0, 1, 2)
    sampler_steps: tuple[int, ...] = (1,)


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0, or 2 with one line on stderr where the input is at fault."""
    parser = CommandParser("ablate", __doc__)
    parser.add_recipe(LearnedTrainConfig, example="ablate_restorer")
    parser.add_argument("--json", required=True, metavar="FILE", help="where to write the figures")
    parser.add_argument("--picture", metavar="PNG", help="draw gain against seconds, by sampler steps")
    return parser.run(_compare, arguments)


def _compare(options: argparse.Namespace) -> None:
    recipe = read_recipe(options.config)
    ablation = _ablation(recipe.pop("ablation", None), options.config)
    jobs = {name: [*options.set, *changes] for name, changes in ablation.variants.items()}
    configs = {name: config_from(LearnedTrainConfig, recipe, changes) for name, changes in jobs.items()}
    rows = {name: _scores(name, config, ablation) for name, config in configs.items()}
    write_text(options.json, json.dumps({"config": recipe, "variants": rows}, indent=1) + "\n")
    if options.picture is not None:
        ablation_chart(rows, ablation.sampler_steps, Path(options.picture))


def _ablation(table, recipe: str) -> Ablation:
    try:
        made = Ablation(**(table or {}))
        return dataclasses.replace(made, seeds=tuple(made.seeds), sampler_steps=tuple(made.sampler_steps))
    except TypeError as error:
        raise InputError(f"{recipe}: [ablation] needs a table `variants`, and takes seeds and sampler_steps") from error


def _scores(name: str, config: LearnedTrainConfig, ablation: Ablation) -> dict:
    """Scores: {metric at N steps: mean over seeds, standard error, each seed's}; hole PSNR in dB, and `gain` over the
    background fill, `ws_` by area on the sphere; seconds of one clip."""
    runs = [_run(name, config, seed, ablation) for seed in ablation.seeds]
    table = {key: [run[key] for run in runs] for key in runs[0]}
    print(name, {key: f"{np.mean(values):.3f}" for key, values in table.items()}, flush=True)
    return {key: {"mean": np.mean(values), "sem": _sem(values), "seeds": values} for key, values in table.items()}


def _sem(values: list[float]) -> float | None:
    return float(np.std(values, ddof=1) / np.sqrt(len(values))) if len(values) > 1 else None


def _run(name: str, config: LearnedTrainConfig, seed: int, ablation: Ablation) -> dict[str, float]:
    config = dataclasses.replace(config, seed=seed, output=str(Path(config.output) / f"{name}-{seed}"))
    scores = Path(config.output) / "scores.json"
    if scores.exists():
        return read_json(scores)
    train_learned(config, resume=True)
    store, (parameters, _) = ExampleStore(config.data.folder), read_restorer(Path(config.output) / "weights.npz")
    found = {}
    for steps in ablation.sampler_steps:
        figures, _ = score_held_out(store, parameters, config, steps=steps)
        found |= {f"{key.removeprefix('held_out_')}_{steps}": value for key, value in figures.items()}
        begun, learned = perf_counter(), Learned(parameters, config.network)
        jax.block_until_ready([restored_colours(learned, store.example(0), steps) for _ in range(_TIMED)])
        found[f"seconds_{steps}"] = (perf_counter() - begun) / _TIMED
    found["parameters"] = sum(np.size(leaf) for leaf in jax.tree.leaves(parameters))
    write_text(scores, json.dumps(found))
    return found


if __name__ == "__main__":
    sys.exit(main())
