"""What super-resolution brings back: rooms lifted from half their rows and upsampled, beside their own rows.

Lifted only, not refined: PSNR and LPIPS at novel views, PSNR of what the input saw; then the rooms' own rows upsampled,
with no more Gaussians; then the rooms' clean videos from half their rows: PSNR, and flicker beside the truth's. Means
over rooms, with standard errors.

    python -m benchmarks.studies.upsample --rooms FOLDER --json benchmarks/results/upsample.json
"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.studies.adaptive_lift import decibels
from benchmarks.studies.room_table import StudiedRoom, run_study
from experiments.evaluate.room import EvaluationRoom, whole
from experiments.reconstruct.config import ReconstructConfig
from rein3d_jax.depth.complete import complete_distance
from rein3d_jax.evaluate.flicker import flicker
from rein3d_jax.evaluate.regions import OBSERVED
from rein3d_jax.geometry.pyramid import halve
from rein3d_jax.lift import LiftConfig
from rein3d_jax.networks.upsampler import read_upsampler
from rein3d_jax.pipeline.stages import render_video
from rein3d_jax.pipeline.survey import lift_scene
from rein3d_jax.rasterize import RasterizeConfig
from rein3d_jax.scene import Panorama, Video
from rein3d_jax.upsample import BICUBIC, LEARNED, UpsampleConfig, distance_for, upsample_picture, upsample_video

RECIPE = "quick"


@dataclass
class Bench:
    """What all rooms share."""

    config: ReconstructConfig
    network: dict

    def lifted(self, rgb: jax.Array, distance: jax.Array, share: float) -> tuple[Panorama, LiftConfig]:
        """What is lifted, and how."""
        given = Panorama(rgb, distance, distance > 0)
        complete = complete_distance(given, config=self.config.depth)
        return whole(replace(given, distance=complete)), replace(self.config.lift, share=share)


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


def rows(at: StudiedRoom) -> Iterator[tuple[str, dict]]:
    """Name and figures of each variant."""
    bench = Bench(at.config, read_upsampler())
    for name, case in cases(bench, at.room.given):
        yield name, at.figures(lift_scene(*case), {"observed": OBSERVED})
    if at.room.traced.video:
        yield from video_rows(bench, at.room).items()


def main(arguments: list[str] | None = None) -> int:
    """Prints a line a variant and room, then the means."""
    return run_study("studies.upsample", __doc__, RECIPE, rows, arguments)


if __name__ == "__main__":
    sys.exit(main())
