"""What carries over when the distance network is trained on drawn rooms, rendered ones, or both.

Also without the backbone's pretraining, and with half of the rendered rooms. Runs of equal length, evaluated on rooms
that none was trained on.

    python -m benchmarks.studies.depth_ablation --json FILE --rendered FOLDER --backbone FOLDER --rooms FOLDER
    python -m benchmarks.studies.depth_ablation --json benchmarks/results/depth_ablation.json

Without folders it prints the table of what FILE holds; with them it trains what FILE lacks, which takes hours on a CPU.
"""

import argparse
import json
import sys
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.depth import network_distance, rendered_rooms, traced_rooms
from experiments.command import CommandParser
from experiments.config import load_config
from experiments.train_depth.config import DepthTrainConfig
from experiments.train_depth.data import DepthData
from experiments.train_depth.held_out import example_errors
from experiments.train_depth.train import train_depth
from rein3d_jax.depth.network.loss import DepthExample
from rein3d_jax.errors import InputError
from rein3d_jax.evaluate.standard_error import over_rooms
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.io.files.json_file import read_json
from rein3d_jax.networks.depth import read_depth_network

SETS = "rendered", "drawn", "traced"
FIGURES = "abs_rel", "within"


@dataclass(frozen=True)
class Variant:
    """What a run is trained on, and what it starts from."""

    name: str
    share: float  # of a batch that is rendered
    pretrained: bool = True
    half: bool = False  # of the rendered rooms


VARIANTS = (
    Variant("drawn", 0.0),
    Variant("rendered", 1.0),
    Variant("both", 0.75),
    Variant("both, backbone not pretrained", 0.75, pretrained=False),
    Variant("both, half of the rendered rooms", 0.75, half=True),
)


def main(arguments: list[str] | None = None) -> int:
    """Prints a line a run, then the table. Exit code 0, or 2 where the input is at fault."""
    parser = CommandParser("studies.depth_ablation", __doc__, package="benchmarks")
    parser.add_argument("--json", type=Path, required=True, help="file of the figures")
    parser.add_argument("--rendered", type=Path, help="folder that experiments.render_rooms wrote")
    parser.add_argument("--backbone", type=Path, help="folder that benchmarks.convert.backbone wrote")
    parser.add_argument("--rooms", type=Path, help="folder of path-traced rooms")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="a key of train_depth's recipe")
    return parser.run(_study, arguments)


def _study(options: argparse.Namespace) -> None:
    told = read_json(options.json) if options.json.exists() else {"runs": []}
    folders = options.rendered, options.backbone, options.rooms
    if any(folders) and not all(folders):
        raise InputError("name all of --rendered, --backbone and --rooms to train, or none to print the table")
    done = {(run["name"], run["seed"]) for run in told["runs"]}
    for seed in range(options.seeds if all(folders) else 0):
        for variant in VARIANTS:
            if (variant.name, seed) not in done:
                told["runs"].append(_run(variant, seed, options))
                write_text(options.json, json.dumps(told, indent=1) + "\n")
    print("\n".join(table(told["runs"])))


def _run(variant: Variant, seed: int, options: argparse.Namespace) -> dict:
    """Figures of one run, whose folder is thrown away."""
    with tempfile.TemporaryDirectory() as scratch:
        config = _config(variant, seed, options, Path(scratch))
        train_depth(config)
        parameters = read_depth_network(Path(config.output) / "weights", config.network)
    drawn = DepthData(replace(config, data=replace(config.data, rendered=""))).drawn_held_out()
    sets = {
        "rendered": rendered_rooms(options.rendered).values(),
        "drawn": [(example.rgb, example.distance) for example in drawn],
        "traced": traced_rooms(options.rooms).values(),
    }
    figures = {name: _figures(parameters, pairs, config.data.height) for name, pairs in sets.items()}
    print(f"{variant.name}, seed {seed}: {figures}", flush=True)
    return {"name": variant.name, "seed": seed, **figures}


def _config(variant: Variant, seed: int, options: argparse.Namespace, scratch: Path) -> DepthTrainConfig:
    config = load_config(DepthTrainConfig, "train_depth", options.set)
    rendered = (
        half_of(options.rendered, scratch / "half", seed, config.data.held_out) if variant.half else options.rendered
    )
    data = replace(config.data, rendered=str(rendered) if variant.share else "", share=variant.share)
    # Evaluated once, at the end: the best of several evaluations would have been chosen on what it is tested on.
    config = replace(config, output=str(scratch / "run"), seed=seed, data=data, evaluate_every=config.steps)
    if variant.pretrained:
        return replace(config, backbone=str(options.backbone))
    return replace(config, backbone="", frozen=0, backbone_rate=1.0)  # what nobody trained is trained like the rest


def half_of(rendered: Path, folder: Path, seed: int, held_out: int) -> Path:
    """`folder`, with links to the rooms that are held out and to half of the others, chosen by the seed."""
    folder.mkdir(parents=True)
    rooms = sorted(path.parent for path in rendered.glob("room_*/room.json"))
    kept = [room for room in rooms if int(room.name.partition("_")[2]) % held_out == 0]
    others = [room for room in rooms if room not in kept]
    chosen = np.random.default_rng(seed).permutation(len(others))[: len(others) // 2]
    for room in [*kept, *(others[index] for index in chosen)]:
        (folder / room.name).symlink_to(room.resolve(), target_is_directory=True)
    return folder


def _figures(parameters: dict, pairs: Iterable[tuple[np.ndarray, np.ndarray]], height: int) -> dict[str, float]:
    """Means over pictures (h, 2 h, 3) and their distances (h, 2 h) over the camera's height."""
    errors = [
        example_errors(DepthExample(rgb, true, true), network_distance(parameters, rgb, height)) for rgb, true in pairs
    ]
    return dict(zip(FIGURES, map(float, np.mean(errors, axis=0)), strict=True))


def table(runs: list[dict]) -> list[str]:
    """Lines of Markdown: means over seeds with standard errors, a row for each name."""
    lines = ["| trained on | seeds | " + " | ".join(f"{name}: AbsRel | within 1.25" for name in SETS) + " |"]
    lines.append("|---" * (2 + 2 * len(SETS)) + "|")
    for name in dict.fromkeys(run["name"] for run in runs):
        mine = [run for run in runs if run["name"] == name]
        values = np.array([[run[kind][figure] for kind in SETS for figure in FIGURES] for run in mine])
        mean, error, _ = over_rooms(values)
        cells = [f"{m:.3f} ± {e:.3f}" if np.isfinite(e) else f"{m:.3f}" for m, e in zip(mean, error, strict=True)]
        lines.append(f"| {name} | {len(mine)} | " + " | ".join(cells) + " |")
    return lines


if __name__ == "__main__":
    sys.exit(main())
