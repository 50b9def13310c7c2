"""The scene with its guesses, refined: the views it is fitted to, how large it may be, what stays as it is."""

import dataclasses
import math
from collections.abc import Iterator, Sequence

import jax
import jax.numpy as jnp
import numpy as np

from rein3d_jax.explore.hidden import in_doubt, on_observed
from rein3d_jax.lift import compact
from rein3d_jax.lift.detail_order import lighter_scene
from rein3d_jax.parallel import data_mesh
from rein3d_jax.pipeline.devices import steps_over
from rein3d_jax.pipeline.stages import Stages, origin_pose
from rein3d_jax.rasterize import bucket
from rein3d_jax.refine import Snapshot, Still, Views, first_snapshot, join_views, refine, views_from_panorama
from rein3d_jax.refine.step import take_step
from rein3d_jax.scene import Gaussians, Panorama, Video

STILL_OF_A_PIXEL = 4  # Gaussians of what stays as it is, for each pixel of six views: with more, no view differs
_GOLDEN_ANGLE = 2.399963  # radians: successive multiples spread the cuts between a trajectory's views evenly


def collect_views(panorama: Panorama, videos: Sequence[Video], *, stages: Stages) -> Views | None:
    """Views of the input panorama and of every restored frame but the origin's, weighed by trust; None where no step is
    to be taken, which would look at them."""
    if stages.refine.steps == 0:
        return None
    config, trust = stages.refine.views, stages.refine.loss
    seen = (panorama.rgb, trust.observed * jnp.ones(panorama.distance.shape), origin_pose())
    parts = [views_from_panorama(*seen, yaw=yaw, config=config) for yaw in (0.0, jnp.pi / 4)]
    for video in videos:
        weight = jnp.where(video.alpha >= stages.restore.observed, trust.observed, trust.restored)
        weight = jnp.where(video.distance > 0, weight, 0.0)
        for index in range(1, video.rgb.shape[0]):
            frame = (video.rgb[index], weight[index], video.world_from_camera[index])
            yaw = float((index * _GOLDEN_ANGLE) % (jnp.pi / 2))
            parts.append(views_from_panorama(*frame, yaw=yaw, config=config))
    return join_views(*parts)


def where_it_pays(stages: Stages, videos: Sequence[Video]) -> Stages:
    """The stages, without steps of refinement where no path was restored: the input alone has nothing new to fit."""
    if any(len(video.rgb) > 1 for video in videos):
        return stages
    return dataclasses.replace(stages, refine=dataclasses.replace(stages.refine, steps=0))


def scene_extent(panorama: Panorama) -> float:
    """Metres: the median known distance, the length that rates and sizes are measured in."""
    known = np.asarray(panorama.distance)[np.asarray(panorama.valid)]
    return float(np.median(known)) if known.size else math.nan


def refine_scene(
    start: Gaussians | Snapshot, views: Views | None, panorama: Panorama, key: jax.Array, *, stages: Stages
) -> Iterator[Snapshot]:
    """`refine`'s snapshots (paper Sec. 3.3) of the scene `start`, brought within its limits, or on from a snapshot."""
    config, raster = stages.refine, stages.rasterize
    if isinstance(start, Gaussians):
        moving, still = _parts(start, panorama, stages)
        extent = scene_extent(panorama)
        start = first_snapshot(moving, views, extent=extent, config=config, raster=raster, still=still)
    chosen = take_step if config.devices == 1 else steps_over(data_mesh(config.devices))
    return refine(start, views, key, config=config, raster=raster, take_step=chosen)


def _parts(scene: Gaussians, panorama: Panorama, stages: Stages) -> tuple[Gaussians, Still | None]:
    """What of the scene may change, in a buffer with room to grow, and what stays as it is; `max_count` Gaussians
    together at most. Buffers of rounded size: the next scene's program is then compiled already."""
    config, limit, still, kept = stages.refine, stages.refine.max_count, None, 0
    if limit:
        scene = lighter_scene(scene, limit)
    living = int(scene.alive.sum())
    if config.freeze_observed and config.steps:
        sure = scene.alive & on_observed(panorama, scene.means) & ~in_doubt(panorama, scene.means)
        kept = int(sure.sum())
        still = compact(scene.replace(alive=sure), capacity=bucket(kept))
        still = Still(still, lighter_scene(still, int(STILL_OF_A_PIXEL * 6 * config.views.size**2)))
        scene = scene.replace(alive=scene.alive & ~sure)
    moving = compact(scene, capacity=bucket(int(living * (1 + config.spare)) - kept))
    if 0 < limit < moving.alive.shape[0] + kept:
        # The living come first. Where none may change there is a dead slot, which nothing brings to life.
        moving = jax.tree.map(lambda x: x[: max(limit - kept, 1)], moving)
    return moving, still
