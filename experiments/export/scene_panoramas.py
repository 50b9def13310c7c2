"""Panoramas of a run's refined scene: what its mesh is fused from, and pictures for a person."""

from collections.abc import Iterator
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from experiments.run_folder import RunFolder
from rein3d_jax.io.pictures.distance import write_distance_exr
from rein3d_jax.io.pictures.exr import write_rgb_exr
from rein3d_jax.io.pictures.image import write_rgb
from rein3d_jax.pipeline.stages import origin_pose, render_video
from rein3d_jax.scene import Video

_SEEN = 0.5  # alpha from which a pixel has a distance


def viewpoints(run: RunFolder) -> dict[str, jax.Array]:
    """Poses world_from_camera (4, 4) by name: the origin, and the middle and the end of each path."""
    poses, trajectories = {"origin": origin_pose()}, run.trajectories
    for path, count in enumerate(np.asarray(trajectories.counts)):
        for name, index in (("middle", count // 2), ("end", count - 1)):
            if index > 0:
                poses[f"path{path}_{name}"] = trajectories.world_from_camera[path, index]
    return poses


def panoramas(run: RunFolder, poses: dict[str, jax.Array]) -> Iterator[Video]:
    """Videos of one frame each of the refined scene, as high as the run worked at; distance 0 where nothing is."""
    raster, height, buffers = run.config.rasterize, len(run.panorama.rgb), None
    for pose in poses.values():
        frame, buffers = render_video(run.refined, pose[None], height, config=raster, buffers=buffers)
        yield frame.replace(distance=jnp.where(frame.alpha > _SEEN, frame.distance, 0.0))


def write_panoramas(run: RunFolder, folder: Path) -> int:
    """Writes NAME.jpg and NAME.exr (linear light) over the run's backdrop and NAME_distance.exr; returns how many."""
    poses = viewpoints(run)
    for name, frame in zip(poses, panoramas(run, poses), strict=True):
        alpha = frame.alpha[0, ..., None]
        rgb = np.asarray(jnp.clip(alpha * frame.rgb[0] + (1 - alpha) * run.backdrop, 0, 1))
        write_rgb(folder / f"{name}.jpg", rgb)
        write_rgb_exr(folder / f"{name}.exr", rgb)
        write_distance_exr(folder / f"{name}_distance.exr", np.asarray(frame.distance[0]))
    return len(poses)
