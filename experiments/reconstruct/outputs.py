"""What a person opens: scene.ply, flythrough.mp4, viewer.html, report.html, metrics.json, in the order in which one
would miss them."""

import json
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from experiments.config import recipe_digest
from experiments.reconstruct import run_metrics
from experiments.reconstruct.flythrough import flythrough
from experiments.reconstruct.pages.run_report import longest, run_report
from experiments.reconstruct.pages.viewer_page import viewer_page
from experiments.reconstruct.quality import quality, render_views
from experiments.reconstruct.run import Pictures, Run
from experiments.reconstruct.stage_store import StageStore
from rein3d_jax.evaluate.coverage import coverage
from rein3d_jax.explore.trajectories import Trajectories, path_ends
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.io.pictures.video import write_mp4
from rein3d_jax.io.splats.ply import write_ply
from rein3d_jax.lift import compact
from rein3d_jax.pipeline.stages import render_video
from rein3d_jax.rasterize import bucket
from rein3d_jax.report.report import render_report
from rein3d_jax.scene import Gaussians


def write_outputs(run: Run, store: StageStore, started: float, foreseen: dict) -> dict:
    """Every file of the run's folder; returns what metrics.json holds, `foreseen` among it. `started` is the job's
    time.perf_counter."""
    config, result, output = run.config, run.result, Path(run.config.output)
    with store.timed("write"), ThreadPoolExecutor(1) as beside:  # a processor has two cores, and a picture takes one
        write_ply(output / "scene.ply", result.scene, antialias=config.rasterize.antialias)
        scenes = _alike(result.coarse, result.scene)
        film = beside.submit(_write_film, scenes[-1], run)
        write_text(output / "viewer.html", viewer_page(run))
        truths = render_views(scenes, run.views, run.backdrop, config=config.rasterize)
        ends = _ends(result.trajectories)
        (coarse_ends, seen), (refined_ends, covered) = (_panoramas(scene, ends, run) for scene in scenes)
        film.result()
    metrics = {
        **run_metrics.cost(store, time.perf_counter() - started),
        **foreseen,
        **run_metrics.size(result, output / "scene.ply"),
        **run_metrics.trouble(result),
        **run_metrics.choices(result, store, config.explore),
        "distance": run.distance_origin,
        "lean": run_metrics.lean(run.lean),
        "recipe": recipe_digest(output / "config.toml"),
        "coverage": {"coarse": round(seen, 4), "refined": round(covered, 4)},
    }
    if run.views:
        metrics["quality"] = {n: quality(p, run.views) for n, p in zip(("coarse", "refined"), truths, strict=True)}
    pictures = Pictures(coarse_ends, refined_ends, *truths)
    write_text(output / "report.html", render_report(run_report(run, pictures, metrics)))
    write_text(output / "metrics.json", json.dumps(metrics, indent=2) + "\n")
    return metrics


def _ends(trajectories: Trajectories) -> jax.Array:
    """(k, 4, 4) poses at the ends of the longest trajectories."""
    return path_ends(trajectories)[np.array(longest(trajectories))]


def _alike(*scenes: Gaussians) -> list[Gaussians]:
    """The scenes in buffers of one size, which then share compiled programs."""
    capacity = bucket(max(int(scene.alive.sum()) for scene in scenes))
    return [compact(scene, capacity=capacity) for scene in scenes]


def _write_film(scene: Gaussians, run: Run) -> None:
    config = run.config
    film = flythrough(scene, run.result.trajectories, run.backdrop, film=config.film, config=config.rasterize)
    write_mp4(Path(config.output) / "flythrough.mp4", film, config.film.rate)


def _panoramas(scene: Gaussians, poses: jax.Array, run: Run) -> tuple[list, float]:
    """What the scene shows there, holes black; and the share of the sphere that it covers, the poses' mean."""
    config, buffers = run.config, run.result.buffers
    video, _ = render_video(scene, poses, config.restore.height, config=config.rasterize, buffers=buffers)
    return list(np.asarray(video.rgb * video.alpha[..., None])), float(jnp.mean(coverage(video.alpha)))
