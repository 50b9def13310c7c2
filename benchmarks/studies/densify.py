"""PSNR against count: default densification, relocation (MCMC) and pruning alone, at five budgets of Gaussians.

    python -m benchmarks.studies.densify --rooms FOLDER [--limit 3] [--json FILE]

All start from the same fused scene and take the same steps over the same views. The baseline is one Gaussian a pixel,
pruned by opacity half-way; densifiers start at 70 % of the budget, by contribution, and grow into the rest.
"""

import json
import sys
from collections import deque
from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.studies.scene import GROWING, RECIPE, SIZE, Bench, summary
from experiments.command import CommandParser
from experiments.compiled_programs import forget_when_many
from experiments.config import load_config
from experiments.evaluate.room import EvaluationRoom, RoomSource, room_sources
from experiments.reconstruct.config import ReconstructConfig
from experiments.reconstruct.quality import is_novel, render_views
from rein3d_jax.evaluate.metrics import psnr
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.lift import compact
from rein3d_jax.pipeline.refine_scene import collect_views, scene_extent
from rein3d_jax.pipeline.stages import Stages
from rein3d_jax.refine import RefineConfig, Views, first_snapshot, refine
from rein3d_jax.refine.prune import contribution, prune_to
from rein3d_jax.refine.views import camera_of
from rein3d_jax.scene import Gaussians

BUDGETS = (1.0, 0.6, 0.4, 0.2, 0.1)  # of the fused scene's Gaussians
START = 0.7  # of the budget
METHODS = ("opacity", "contribution", "default", "mcmc")


def fit(scene: Gaussians, views: Views, extent: float, config: RefineConfig, stages: Stages) -> Gaussians:
    """`refine` with key 1."""
    start = first_snapshot(scene, views, extent=extent, config=config, raster=stages.rasterize)
    last = deque(refine(start, views, jax.random.key(1), config=config, raster=stages.rasterize), maxlen=1)
    return last[0].scene


def scene_of(method: str, count: int, scene: Gaussians, views: Views, extent: float, stages: Stages) -> Gaussians:
    """At most `count` Gaussians, after all of the recipe's steps."""
    config = stages.refine
    still = replace(config, densification="none", spare=0.0)
    if method == "opacity":
        half = replace(still, steps=config.steps // 2)
        grown = fit(compact(scene), views, extent, half, stages)
        pruned = prune_to(grown, jax.nn.sigmoid(grown.opacity_logits), count)
        return fit(compact(pruned), views, extent, half, stages)
    cameras = [camera_of(views, int(i)) for i in np.linspace(0, len(views.rgb) - 1, 48)]
    weight = contribution(scene, cameras, config=stages.rasterize)
    if method == "contribution":
        return fit(compact(prune_to(scene, weight, count)), views, extent, still, stages)
    start = int(START * count)
    buffer = compact(prune_to(scene, weight, start), capacity=count)
    return fit(buffer, views, extent, replace(config, densification=method), stages)


def measure(source: RoomSource, config: ReconstructConfig) -> dict[str, dict]:
    """Row -> figures of a room."""
    states, _ = (bench := Bench(source)).fused(config)
    panorama, room = bench.made[config.input.height][0], EvaluationRoom(source, config)
    views = collect_views(panorama, [state.video for state in states], stages=config)
    truth = [view for view in room.traced.views if is_novel(view)]
    living, rows = int(states[-1].scene.alive.sum()), {}
    for budget in BUDGETS:
        for method in METHODS:
            count = int(budget * living)
            scene = scene_of(method, count, states[-1].scene, views, scene_extent(panorama), config)
            (pictures,) = render_views([scene], truth, room.backdrop, config=config.rasterize)
            found = float(np.mean([psnr(p, view.rgb) for p, view in zip(pictures, truth, strict=True)]))
            row = {"psnr": found, "count": int(jnp.sum(scene.alive)), "seconds": 0.0, "paths": len(states)}
            rows[f"{method}, {budget:.0%}"] = row
            print(source.name, method, budget, row, flush=True)
            forget_when_many()
    return rows


def main(arguments: list[str] | None = None) -> int:
    """Prints a line a row."""
    parser = CommandParser("studies.densify", __doc__, "benchmarks")
    parser.add_argument("--rooms", metavar="FOLDER", required=True)
    parser.add_argument("--limit", type=int, help="rooms at most")
    parser.add_argument("--json", metavar="FILE", help="write the table there")
    return parser.run(_run, arguments)


def _run(options) -> None:
    sources = room_sources(options.rooms, options.limit)
    config = load_config(ReconstructConfig, RECIPE, [*SIZE, *GROWING])
    found = [measure(source, config) for source in sources]
    rows = {}
    for name in found[0]:
        base = [room["opacity, " + name.split(", ")[1]] for room in found]
        rows[name] = summary([room[name] for room in found], base)
        del rows[name]["seconds"]
        print(f"{name:24s}", rows[name])
    if options.json:
        rooms = [source.name for source in sources]
        table = {"recipe": RECIPE, "changed": (*SIZE, *GROWING), "rooms": rooms, "rows": rows}
        write_text(Path(options.json), json.dumps(table, indent=1) + "\n")


if __name__ == "__main__":
    sys.exit(main())
