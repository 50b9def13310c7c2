"""Exploring and restoring: path by path, what the scene shows, its holes filled, and the guesses fused into the scene
(paper Sec. 3.1, 3.2)."""

from collections.abc import Iterator

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.evaluate.coverage import coverage
from rein3d_jax.explore.trajectories import path_ends
from rein3d_jax.geometry.poses import equirectangular_camera
from rein3d_jax.pipeline.fuse import Fused, fuse_guesses
from rein3d_jax.pipeline.stages import Stages, render_video
from rein3d_jax.pipeline.survey import Survey
from rein3d_jax.rasterize import Buffers, allocate
from rein3d_jax.restore import Restorer
from rein3d_jax.scene import Gaussians, Video


@struct.dataclass
class Explored:
    """The scene after some trajectories: enough to go on with the next one, to the bit."""

    scene: Gaussians | None  # none where `lightly` has left it to a later state
    video: Video  # the last trajectory's frames, holes filled; alpha still says what was observed. The last frame alone
    # where the path revealed too little to be restored
    taken: jax.Array  # () trajectories so far
    revealed: jax.Array  # () share of the sphere that was open at the last path's end
    overflow: jax.Array  # () Gaussians that found no slot in the scene's buffer, so far
    buffers: jax.Array  # (4,) the rasterizer's sizes: sums over buffers of another size round otherwise


def explore_and_restore(
    known: Survey, restore: Restorer, key: jax.Array, *, stages: Stages, start: Explored | None = None
) -> Iterator[Explored]:
    """The state after each trajectory, from the first, or from the one after `start`. `restore` is `restorer`'s."""
    last = start
    for index in range(0 if start is None else int(start.taken), len(known.trajectories.counts)):
        last = _explored(known, restore, jax.random.fold_in(key, index), stages, last)
        yield last


def lightly(states: Iterator[Explored]) -> list[Explored]:
    """All of `explore_and_restore`'s states, the scene in the last one alone: one of 2048 rows takes 0.3 GB."""
    kept: list[Explored] = []
    for state in states:
        kept = [*(one.replace(scene=None) for one in kept), state]
    return kept


def _explored(known: Survey, restore: Restorer, key: jax.Array, stages: Stages, last: Explored | None) -> Explored:
    """The state after the trajectory that follows `last`."""
    if last is None:
        index, before = 0, Fused(known.coarse, 0, _first_buffers(known, stages))
    else:
        index = int(last.taken)
        before = Fused(last.scene, int(last.overflow), Buffers(*map(int, last.buffers)))
    paths, height, raster = known.trajectories, stages.restore.height, stages.rasterize
    poses = paths.world_from_camera[index, : int(paths.counts[index])]
    seen = before.scene if stages.restore.sequential else known.coarse
    end, buffers = render_video(seen, poses[-1:], height, config=raster, buffers=before.buffers)
    revealed = 1 - jnp.mean(coverage(end.alpha))
    if revealed < stages.explore.min_revealed:
        video, after = end, before.replace(buffers=buffers)
    else:
        degraded, buffers = render_video(seen, poses, height, config=raster, buffers=buffers)
        video, after = restore(degraded, key), before.replace(buffers=buffers)
        if stages.restore.method != "none" and stages.restore.fuse_every:
            after = fuse_guesses(after, degraded, video, known.panorama, stages)
    counts = (jnp.asarray(index + 1), revealed, jnp.asarray(after.overflow), jnp.array(after.buffers))
    return Explored(after.scene, video, *counts)


def _first_buffers(known: Survey, stages: Stages) -> Buffers:
    cameras = [equirectangular_camera(pose, stages.restore.height) for pose in path_ends(known.trajectories)]
    # What exploring adds needs room too; 1.5 keeps most runs from compiling the rasterizer twice.
    return allocate(known.coarse, cameras, config=stages.rasterize, slack=1.5)
