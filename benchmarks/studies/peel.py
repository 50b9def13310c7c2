"""What the layers behind a panorama bring: rooms lifted, then with each layer, before any path is taken.

PSNR and LPIPS at novel views; PSNR over all pixels that the input observed, that something hid, that were never seen;
Gaussians; and the seconds that the layers took, the first time compiled before. Means over rooms, with standard errors.

    python -m benchmarks.studies.peel --rooms FOLDER --json benchmarks/results/peel.json
"""

import json
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.studies.adaptive_lift import decibels
from benchmarks.studies.upsample import summary
from experiments.command import CommandParser
from experiments.config import load_config
from experiments.evaluate.held_out import HeldOutPicture, held_out_pictures
from experiments.evaluate.room import EvaluationRoom, room_sources
from experiments.reconstruct.config import ReconstructConfig
from rein3d_jax.evaluate.lpips import lpips
from rein3d_jax.evaluate.regions import DISOCCLUDED, NEVER_SEEN, OBSERVED
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.io.weights.metric_weights import lpips_weights
from rein3d_jax.networks.trained import read_network
from rein3d_jax.peel import PeelConfig
from rein3d_jax.pipeline.peel_scene import peel_scene
from rein3d_jax.pipeline.survey import room_background, survey
from rein3d_jax.rasterize import Buffers, RasterizeConfig, render
from rein3d_jax.restore import restorer
from rein3d_jax.scene import Gaussians

RECIPE = "draft"
_REGIONS = {"seen": OBSERVED, "hidden": DISOCCLUDED, "never": NEVER_SEEN}


def scenes(room: EvaluationRoom, config: ReconstructConfig) -> Iterator[tuple[str, Gaussians, float]]:
    """Name, scene, and seconds of its layers."""
    panorama = room.panorama
    known, background = survey(panorama, config), room_background(panorama, config.restore)
    yield "lifted", known.coarse, 0.0
    cases = {
        "+ room, by the shell's colours": ("background", PeelConfig(room=True, outside=False)),
        "+ room, learned": ("learned", PeelConfig(room=True, outside=False)),
        "+ outside": ("learned", PeelConfig(room=False, outside=True)),
        "+ room, learned, + outside": ("learned", PeelConfig()),
    }
    for name, (method, layers) in cases.items():
        stages = replace(config, peel=layers, restore=replace(config.restore, method=method))
        restore = restorer(stages.restore, background, read_network(stages.restore))
        for _ in range(2):  # the first compiles
            started = perf_counter()
            scene = jax.block_until_ready(peel_scene(known, background, restore, jax.random.key(0), stages=stages))
            seconds = perf_counter() - started
        yield name, scene, seconds


def figures(scene: Gaussians, views: list[HeldOutPicture], room: EvaluationRoom, buffers: Buffers | None) -> tuple:
    """A scene's figures at novel views, and the rasterizer's buffers as they have grown."""
    pictures, errors = [], []
    for view in views:
        frame, buffers = render(scene, view.camera, config=RasterizeConfig(), buffers=buffers)
        pictures.append(jnp.clip(frame.rgb + (1 - frame.alpha)[..., None] * room.backdrop, 0, 1))
        errors.append(np.mean((np.asarray(pictures[-1]) - np.asarray(view.rgb)) ** 2, axis=-1))
    regions = np.stack([np.asarray(view.region) for view in views])
    found = {"psnr": float(np.mean([decibels(error) for error in errors]))}
    found |= {name: decibels(np.stack(errors)[regions == region]) for name, region in _REGIONS.items()}
    distances = lpips(lpips_weights(), jnp.stack(pictures), jnp.stack([view.rgb for view in views]))
    return found | {"lpips": float(distances.mean()), "count": int(scene.alive.sum())}, buffers


def main(arguments: list[str] | None = None) -> int:
    """Prints a line a variant and room, then the means."""
    parser = CommandParser("studies.peel", __doc__, "benchmarks")
    parser.add_argument("--rooms", metavar="FOLDER", required=True)
    parser.add_argument("--json", metavar="FILE", help="write the table there")
    return parser.run(_run, arguments)


def _run(options) -> None:
    config, table, buffers = load_config(ReconstructConfig, RECIPE, []), {}, None
    for source in room_sources(options.rooms):
        room = EvaluationRoom(source, config)
        views = [view for view in held_out_pictures(room) if view.kind == "view"]
        for name, scene, seconds in scenes(room, config):
            row, buffers = figures(scene, views, room, buffers)
            row["seconds"] = seconds
            table.setdefault(name, []).append(row)
            print(source.name, name, {key: round(value, 4) for key, value in row.items()}, flush=True)
        if options.json:
            report = {"recipe": RECIPE, "columns": "mean, standard error"}
            report |= {"rows": {name: summary(rows) | {"rooms": rows} for name, rows in table.items()}}
            write_text(Path(options.json), json.dumps(report, indent=1) + "\n")
    for name, rows in table.items():
        print(f"{name:34}", summary(rows))


if __name__ == "__main__":
    sys.exit(main())
