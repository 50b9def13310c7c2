"""The scene with its guesses, refined: the views it is fitted to, how large it may be, what stays as it is."""

import dataclasses
from collections.abc import Iterator, Sequence

import jax
import jax.numpy as jnp

from rein3d_jax.explore.hidden import in_doubt, on_observed
from rein3d_jax.lift import compact
from rein3d_jax.lift.detail_order import lighter_scene
from rein3d_jax.parallel import data_mesh
from rein3d_jax.pipeline.devices import steps_over
from rein3d_jax.pipeline.stages import Stages, origin_pose
from rein3d_jax.rasterize import bucket
from rein3d_jax.refine import Snapshot, Views, first_snapshot, join_views, refine, views_from_panorama
from rein3d_jax.refine.step import take_step
from rein3d_jax.scene import Gaussians, Panorama, Video

_GOLDEN_ANGLE = 2.399963  # radians: successive multiples spread the cuts between a trajectory's views evenly


def collect_views(panorama: Panorama, videos: Sequence[Video], *, stages: Stages) -> Views:
    """Views of the input panorama and of every restored frame but the origin's, weighed by trust."""
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
    return float(jnp.nanmedian(jnp.where(panorama.valid, panorama.distance, jnp.nan)))


def refine_scene(
    start: Gaussians | Snapshot, views: Views, panorama: Panorama, key: jax.Array, *, stages: Stages
) -> Iterator[Snapshot]:
    """`refine`'s snapshots (paper Sec. 3.3) of the scene `start`, brought within its limits, or on from a snapshot."""
    config, raster = stages.refine, stages.rasterize
    if isinstance(start, Gaussians):
        scene = _within_limits(start, stages)
        sure = on_observed(panorama, scene.means) & ~in_doubt(panorama, scene.means)
        fixed = sure if config.freeze_observed else None
        extent = scene_extent(panorama)
        start = first_snapshot(scene, views, extent=extent, config=config, raster=raster, fixed=fixed)
    chosen = take_step if config.devices == 1 else steps_over(data_mesh(config.devices))
    return refine(start, views, key, config=config, raster=raster, take_step=chosen)


def _within_limits(scene: Gaussians, stages: Stages) -> Gaussians:
    """The scene with `max_count` Gaussians at most, in a buffer with room to grow. Buffers of rounded size: the next
    scene's program is then compiled already."""
    limit = stages.refine.max_count
    if limit:
        scene = lighter_scene(scene, limit)
    scene = compact(scene, capacity=bucket(int(int(scene.alive.sum()) * (1 + stages.refine.spare))))
    if 0 < limit < scene.alive.shape[0]:
        scene = jax.tree.map(lambda x: x[:limit], scene)  # the living come first
    return scene
