"""What super-resolution brings back: rooms lifted from half their rows and upsampled, beside their own rows.

Lifted only, not refined: PSNR and LPIPS at novel views, PSNR of what the input saw; then the rooms' own rows upsampled,
with no more Gaussians; then the rooms' clean videos from half their rows: PSNR, and flicker beside the truth's. Means
over rooms, with standard errors.

    python -m benchmarks.studies.upsample --rooms FOLDER --json benchmarks/results/upsample.json
"""

import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.studies.adaptive_lift import decibels
from experiments.command import CommandParser
from experiments.config import load_config
from experiments.evaluate.held_out import HeldOutPicture, held_out_pictures
from experiments.evaluate.room import EvaluationRoom, room_sources, whole
from experiments.reconstruct.config import ReconstructConfig
from rein3d_jax.depth.complete import complete_distance
from rein3d_jax.evaluate.flicker import flicker
from rein3d_jax.evaluate.lpips import lpips
from rein3d_jax.evaluate.regions import OBSERVED
from rein3d_jax.geometry.pyramid import halve
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.io.weights.metric_weights import lpips_weights
from rein3d_jax.lift import LiftConfig
from rein3d_jax.networks.upsampler import read_upsampler
from rein3d_jax.pipeline.stages import render_video
from rein3d_jax.pipeline.survey import lift_scene
from rein3d_jax.rasterize import Buffers, RasterizeConfig, render
from rein3d_jax.scene import Panorama, Video
from rein3d_jax.upsample import BICUBIC, LEARNED, UpsampleConfig, distance_for, upsample_picture, upsample_video

RECIPE = "quick"


@dataclass
class Bench:
    """What all rooms share; the rasterizer's buffers grow from room to room."""

    config: ReconstructConfig
    network: dict
    lpips: dict
    buffers: Buffers | None = None

    def lifted(self, rgb: jax.Array, distance: jax.Array, share: float) -> tuple[Panorama, LiftConfig]:
        """What is lifted, and how."""
        complete = complete_distance(distance, distance > 0, config=self.config.depth)
        return whole(Panorama(rgb, complete, distance > 0)), replace(self.config.lift, share=share)

    def row(self, case: tuple[Panorama, LiftConfig], views: list[HeldOutPicture], backdrop: jax.Array) -> dict:
        """A scene's figures at novel views."""
        scene = lift_scene(*case)
        novel, observed, pictures = [], [], []
        for view in views:
            frame, self.buffers = render(scene, view.camera, config=RasterizeConfig(), buffers=self.buffers)
            picture = jnp.clip(frame.rgb + (1 - frame.alpha)[..., None] * backdrop, 0, 1)
            squared = np.mean((np.asarray(picture) - np.asarray(view.rgb)) ** 2, axis=-1)
            novel.append(decibels(squared))
            observed.append(squared[np.asarray(view.region) == OBSERVED])
            pictures.append(picture)
        distances = lpips(self.lpips, jnp.stack(pictures), jnp.stack([view.rgb for view in views]))
        figures = {"psnr": np.mean(novel), "observed": decibels(np.concatenate(observed)), "lpips": distances.mean()}
        return {"count": int(scene.alive.sum())} | {name: float(value) for name, value in figures.items()}


def cases(bench: Bench, given: Panorama) -> Iterator[tuple[str, tuple[Panorama, LiftConfig]]]:
    """Name, and what is lifted of a room's input."""
    rgb, distance = given.rgb, jnp.where(given.valid, given.distance, 0.0)
    half = halve(rgb)
    half_distance = distance_for(half, distance)
    yield "half rows", bench.lifted(half, half_distance, 1.0)
    for method in (BICUBIC, LEARNED):
        fine = upsample_picture(half, method, bench.network)
        yield f"half rows, {method}", bench.lifted(fine, distance_for(fine, half_distance), 1.0)
    yield "half rows, learned, distance's own rows", bench.lifted(fine, distance, 1.0)
    yield "own rows", bench.lifted(rgb, distance, 1.0)
    for method in (BICUBIC, LEARNED):
        fine = upsample_picture(rgb, method, bench.network)
        yield f"own rows, {method}, share 0.25", bench.lifted(fine, distance_for(fine, distance), 0.25)
    yield "own rows, learned, share 0.125", bench.lifted(fine, distance_for(fine, distance), 0.125)


def video_rows(bench: Bench, room: EvaluationRoom) -> dict[str, dict]:
    """Figures of a room's clean video from half its rows, by method."""
    truth, given = room.clip_rgb, whole(room.panorama)
    poses = jnp.stack([jnp.asarray(frame.world_from_camera, jnp.float32) for frame in room.traced.video])
    half = jax.vmap(halve)(truth)
    scene = lift_scene(given, replace(bench.config.lift, share=1.0))
    video, _ = render_video(scene, poses, half.shape[1], config=RasterizeConfig())
    video = Video(half, video.alpha, video.distance, poses)
    rows = {"video, truth": {"flicker": float(flicker(truth))}}
    for method in (BICUBIC, LEARNED):
        for reference in (False, True):
            config = UpsampleConfig(method, reference)
            rgb = upsample_video(video, given, bench.network, config=config).rgb
            name = f"video, {method}" + (", reference" if reference else "")
            squared = np.mean((np.asarray(rgb) - np.asarray(truth)) ** 2, axis=-1)
            rows[name] = {"psnr": decibels(squared), "flicker": float(flicker(rgb))}
    return rows


def summary(rows: list[dict]) -> dict:
    """Mean and standard error of each figure over rooms."""
    return {
        key: [round(float(np.mean([row[key] for row in rows])), 4)]
        + [round(float(np.std([row[key] for row in rows], ddof=1)) / len(rows) ** 0.5, 4)] * (len(rows) > 1)
        for key in rows[0]
    }


def main(arguments: list[str] | None = None) -> int:
    """Prints a line a variant and room, then the means."""
    parser = CommandParser("studies.upsample", __doc__, "benchmarks")
    parser.add_argument("--rooms", metavar="FOLDER", required=True)
    parser.add_argument("--json", metavar="FILE", help="write the table there")
    return parser.run(_run, arguments)


def _run(options) -> None:
    config = load_config(ReconstructConfig, RECIPE, [])
    bench, table = Bench(config, read_upsampler(), lpips_weights()), {}
    for source in room_sources(options.rooms):
        room = EvaluationRoom(source, config)
        views = [view for view in held_out_pictures(room) if view.kind == "view"]
        rows = {name: bench.row(case, views, room.backdrop) for name, case in cases(bench, room.given)}
        if room.traced.video:
            rows |= video_rows(bench, room)
        for name, row in rows.items():
            table.setdefault(name, []).append(row)
            print(source.name, name, {key: round(value, 4) for key, value in row.items()}, flush=True)
        if options.json:
            report = {"recipe": RECIPE, "columns": "mean, standard error"}
            report |= {"rows": {name: summary(rows) | {"rooms": rows} for name, rows in table.items()}}
            write_text(Path(options.json), json.dumps(report, indent=1) + "\n")
    for name, rows in table.items():
        print(f"{name:44}", summary(rows))


if __name__ == "__main__":
    sys.exit(main())
