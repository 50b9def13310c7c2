"""A study of scenes at novel views: its command line, its rows room by room, its means with standard errors."""

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from benchmarks.studies.adaptive_lift import decibels
from experiments.command import CommandParser
from experiments.config import load_config
from experiments.evaluate.held_out import HeldOutPicture, held_out_pictures
from experiments.evaluate.room import EvaluationRoom, room_sources
from experiments.reconstruct.config import ReconstructConfig
from rein3d_jax.evaluate.lpips import lpips
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.io.weights.metric_weights import lpips_weights
from rein3d_jax.rasterize import Buffers, RasterizeConfig, render
from rein3d_jax.scene import Gaussians


@dataclass
class StudiedRoom:
    """A room, and the figures of scenes at its novel views; the rasterizer's buffers grow."""

    config: ReconstructConfig
    room: EvaluationRoom
    views: list[HeldOutPicture]
    lpips: dict
    buffers: Buffers | None

    def figures(self, scene: Gaussians, regions: dict[str, int]) -> dict:
        """PSNR, meaned over the views; PSNR over all pixels of each region, by its name; LPIPS; Gaussians."""
        pictures, errors = [], []
        for view in self.views:
            frame, self.buffers = render(scene, view.camera, config=RasterizeConfig(), buffers=self.buffers)
            pictures.append(frame.over(self.room.backdrop))
            errors.append(np.mean((np.asarray(pictures[-1]) - np.asarray(view.rgb)) ** 2, axis=-1))
        shown, error = np.stack([np.asarray(view.region) for view in self.views]), np.stack(errors)
        found = {"psnr": float(np.mean([decibels(squared) for squared in errors]))}
        found |= {name: float(decibels(error[shown == region])) for name, region in regions.items()}
        distances = lpips(self.lpips, jnp.stack(pictures), jnp.stack([view.rgb for view in self.views]))
        return found | {"lpips": float(distances.mean()), "count": int(scene.alive.sum())}


# room -> (variant, its figures), one after another
RowsOfRoom = Callable[[StudiedRoom], Iterable[tuple[str, dict]]]


def run_study(name: str, doc: str, recipe: str, rows_of_room: RowsOfRoom, arguments: list[str] | None) -> int:
    """Exit code of the study `name`: prints a line a variant and room, then the means; --json writes them as they
    come."""
    parser = CommandParser(name, doc, "benchmarks")
    parser.add_argument("--rooms", metavar="FOLDER", required=True)
    parser.add_argument("--json", metavar="FILE", help="write the table there")
    return parser.run(lambda options: _run(options, recipe, rows_of_room), arguments)


def _run(options, recipe: str, rows_of_room: RowsOfRoom) -> None:
    config, weights, table, buffers = load_config(ReconstructConfig, recipe, []), lpips_weights(), {}, None
    for source in room_sources(options.rooms):
        room = EvaluationRoom(source, config)
        views = [view for view in held_out_pictures(room) if view.kind == "view"]
        studied = StudiedRoom(config, room, views, weights, buffers)
        for name, row in rows_of_room(studied):
            table.setdefault(name, []).append(row)
            print(source.name, name, {key: round(value, 4) for key, value in row.items()}, flush=True)
        buffers = studied.buffers
        if options.json:
            report = {"recipe": recipe, "columns": "mean, standard error"}
            report |= {"rows": {name: _summary(rows) | {"rooms": rows} for name, rows in table.items()}}
            write_text(Path(options.json), json.dumps(report, indent=1) + "\n")
    for name, rows in table.items():
        print(f"{name:44}", _summary(rows))


def mean_and_error(values: Sequence[float], *, digits: int = 4) -> list[float]:
    """Mean and its standard error, which is 0 of a single value."""
    error = np.std(values, ddof=1) / len(values) ** 0.5 if len(values) > 1 else 0.0
    return [round(float(np.mean(values)), digits), round(float(error), digits)]


def _summary(rows: list[dict]) -> dict:
    """Mean and standard error of each figure over rooms."""
    return {
        key: [round(float(np.mean([row[key] for row in rows])), 4)]
        + [round(float(np.std([row[key] for row in rows], ddof=1)) / len(rows) ** 0.5, 4)] * (len(rows) > 1)
        for key in rows[0]
    }
