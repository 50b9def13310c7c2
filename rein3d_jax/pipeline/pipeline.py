"""The stages joined: one panorama in, one refined scene out. Pure of files; `reconstruct` reads, saves and resumes."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from rein3d_jax.depth.complete import CompleteConfig
from rein3d_jax.depth.shell_from_distance import shell_from_distance
from rein3d_jax.evaluate.coverage import coverage
from rein3d_jax.explore.hidden import hidden_distance, on_observed
from rein3d_jax.explore.profile import ExploreConfig
from rein3d_jax.explore.trajectories import Trajectories
from rein3d_jax.geometry.poses import equirectangular_camera, rigid
from rein3d_jax.geometry.sphere import rays_of_pose, world_from_camera_axes
from rein3d_jax.lift import LiftConfig, compact, lift, lift_adaptively, merge, with_capacity
from rein3d_jax.parallel import data_mesh
from rein3d_jax.pipeline.devices import steps_over
from rein3d_jax.rasterize import RasterizeConfig, allocate, bucket, enlarge, render
from rein3d_jax.refine import RefineConfig, Views, join_views, refine, views_from_panorama
from rein3d_jax.refine.merge_duplicates import merge_duplicates
from rein3d_jax.refine.prune import contribution, prune_to, prune_within
from rein3d_jax.refine.views import camera_of
from rein3d_jax.restore import Background, Network, RestoreConfig, background_of, restorer
from rein3d_jax.scene import Gaussians, Panorama, Video

MOVED = 1e-3  # relative: more than rounding, less than the least move of hidden_distance
GOLDEN_TURN = 2.399963  # radians: successive multiples spread the cuts between a trajectory's views evenly


@dataclasses.dataclass(frozen=True)
class Stages:
    """One config for each stage."""

    depth: CompleteConfig = CompleteConfig()
    lift: LiftConfig = LiftConfig()
    explore: ExploreConfig = ExploreConfig()
    rasterize: RasterizeConfig = RasterizeConfig()
    restore: RestoreConfig = RestoreConfig()
    refine: RefineConfig = RefineConfig()


def origin_pose() -> jax.Array:
    """world_from_camera (4, 4) of the input panorama."""
    return rigid(world_from_camera_axes(), jnp.zeros(3))


def lift_scene(panorama: Panorama, config: LiftConfig) -> Gaussians:
    """The coarse scene, in a buffer with room for what exploring will add."""
    everywhere = jnp.ones(panorama.distance.shape, bool)
    placed = panorama.replace(valid=everywhere)  # an unknown distance was completed; its colour is known
    scene = lift_adaptively(placed, origin_pose(), everywhere, config=config)
    return with_capacity(scene, config.capacity or scene.alive.size + everywhere.size // config.stride**2)


def render_video(gaussians: Gaussians, poses: jax.Array, height: int, raster: RasterizeConfig):
    """Panoramas along `poses` (t, 4, 4) -> (Video with colour un-premultiplied, the config with grown buffers)."""
    frames = []
    for pose in poses:
        frame, raster = render(gaussians, equirectangular_camera(pose, height), config=raster)
        frames.append((frame.rgb / jnp.maximum(frame.alpha, 1e-6)[..., None], frame.alpha, frame.distance))
    rgb, alpha, distance = (jnp.stack(part) for part in zip(*frames, strict=True))
    return Video(jnp.clip(rgb, 0, 1), alpha, distance, poses), raster


def _fuse(scene: Gaussians, degraded: Video, restored: Video, panorama: Panorama, stages: Stages, raster):
    """Lift a restored video into what `scene` leaves open, farthest frame first: it opens the largest holes, and the
    nearer ones then see them closed. Returns (scene, overflow, raster)."""
    overflow, last = 0, restored.rgb.shape[0] - 1
    # Edges were snapped when the input was lifted; a guess has none to mend, and every pixel of it is lifted.
    config = dataclasses.replace(stages.lift, snap_edges=False, stride=1)
    # One that had to move lies on no surface that anybody saw: stretched along its neighbours it made fog.
    round_ones = dataclasses.replace(config, steepest=0.0)
    for index in range(last, 0, -stages.restore.fuse_every):
        camera = equirectangular_camera(restored.world_from_camera[index], restored.rgb.shape[1])
        alpha = degraded.alpha[index]
        if index < last or not stages.restore.sequential:  # the scene has grown since the video was rendered
            frame, raster = render(scene, camera, config=raster)
            alpha = frame.alpha
        guess, hole = _guess(restored, index, alpha, panorama, stages)
        moved = jnp.abs(guess.distance - restored.distance[index]) > MOVED * guess.distance
        for part, config_of_part in ((hole & ~moved, config), (hole & moved, round_ones)):
            scene, dropped = merge(scene, lift(guess, camera.world_from_camera, part, config=config_of_part))
            overflow += int(dropped)
    return scene, overflow, raster


def _guess(video: Video, index: int, alpha: jax.Array, panorama: Panorama, stages: Stages):
    """Frame `index` with its guesses moved into unseen space, and the holes (h, w) that they are to fill."""
    rgb, distance, pose = (x[index] for x in (video.rgb, video.distance, video.world_from_camera))
    place = hidden_distance(panorama, pose[:3, 3], rays_of_pose(pose, *distance.shape), distance)
    return Panorama(rgb, place, place > 0), (alpha < stages.restore.observed) & (place > 0)


@struct.dataclass
class Restored:
    """The job's state after a trajectory: enough to go on with the next one, to the bit."""

    scene: Gaussians
    video: Video  # the trajectory's frames, holes filled; alpha still says what was observed. The first one alone
    # where the path revealed too little to be restored
    revealed: jax.Array  # () share of the sphere that was open at the path's end
    overflow: jax.Array  # () Gaussians that found no slot in the scene's buffer, so far
    buffers: jax.Array  # (4,) the rasterizer's capacities: sums over other buffer sizes round otherwise


def restore_trajectory(
    coarse: Gaussians,
    panorama: Panorama,
    trajectories: Trajectories,
    index: int,
    last: Restored | None,
    key: jax.Array,
    *,
    stages: Stages,
    background: Background | None,
    network: Network | None = None,
) -> Restored:
    """The state after trajectory `index`; `last` is the one before, None at the first (paper Sec. 3.1, 3.2).
    `background` is what `room_background` found, `network` what stages.restore was trained to, where it was."""
    if last is None:
        scene, overflow, raster = coarse, 0, _first_buffers(coarse, trajectories, stages)
    else:
        scene, overflow = last.scene, int(last.overflow)
        raster = enlarge(stages.rasterize, *(int(x) for x in last.buffers))
    poses = trajectories.world_from_camera[index, : int(trajectories.counts[index])]
    seen = scene if stages.restore.sequential else coarse
    end, raster = render_video(seen, poses[-1:], stages.restore.height, raster)
    revealed = 1 - jnp.mean(coverage(end.alpha))
    if revealed < stages.explore.least:
        start, raster = render_video(seen, poses[:1], stages.restore.height, raster)
        return Restored(scene, start, revealed, jnp.asarray(overflow), jnp.array(raster.buffers))
    degraded, raster = render_video(seen, poses, stages.restore.height, raster)
    restored = restorer(stages.restore, background, network)(degraded, jax.random.fold_in(key, index))
    if stages.restore.method != "none":
        scene, dropped, raster = _fuse(scene, degraded, restored, panorama, stages, raster)
        overflow += dropped
    return Restored(scene, restored, revealed, jnp.asarray(overflow), jnp.array(raster.buffers))


def _first_buffers(coarse: Gaussians, trajectories: Trajectories, stages: Stages) -> RasterizeConfig:
    ends = [poses[int(n) - 1] for poses, n in zip(trajectories.world_from_camera, trajectories.counts, strict=True)]
    cameras = [equirectangular_camera(pose, stages.restore.height) for pose in ends]
    # What exploring adds needs room too; 1.5 keeps most runs from compiling the rasterizer twice.
    return allocate(coarse, cameras, config=stages.rasterize, slack=1.5)


def room_background(panorama: Panorama, config: RestoreConfig) -> Background | None:
    """The room's shell with its colours, or None where what was seen is no box."""
    shell, support = shell_from_distance(panorama)
    return background_of(panorama, shell) if float(support) >= config.shell_support else None


def collect_views(panorama: Panorama, videos: list[Video], *, stages: Stages) -> Views:
    """Views of the input panorama and of every restored frame but the origin's, weighed by trust. Only the input's have
    a distance to fit: what a frame shows was rendered or guessed."""
    config, whole = stages.refine, jnp.ones(panorama.distance.shape)
    known = jnp.where(panorama.valid, panorama.distance, 0.0)
    of_input = (panorama.rgb, config.observed_weight * whole, known, origin_pose())
    turns = (0.0,) if config.panoramic else (0.0, jnp.pi / 4)
    parts = [views_from_panorama(*of_input, source=0, turn=turn, config=config) for turn in turns]
    for source, video in enumerate(videos, start=1):
        weight = jnp.where(video.alpha >= stages.restore.observed, config.observed_weight, config.restored_weight)
        weight = jnp.where(video.distance > 0, weight, 0.0)
        for index in range(1, video.rgb.shape[0]):
            pose, turn = video.world_from_camera[index], float((index * GOLDEN_TURN) % (jnp.pi / 2))
            frame = (video.rgb[index], weight[index], jnp.zeros_like(weight[index]), pose)
            parts.append(views_from_panorama(*frame, source=source, turn=turn, config=config))
    return join_views(*parts)


def scene_extent(panorama: Panorama) -> float:
    """Metres: the median known distance, the length that rates and sizes are measured in."""
    return float(jnp.nanmedian(jnp.where(panorama.valid, panorama.distance, jnp.nan)))


WEIGHED = 48  # views, evenly through the list, by which a scene is pruned


def _needed(scene: Gaussians, views: Views, stages: Stages) -> Gaussians:
    """What the views need of the scene, within the budget, in a buffer with room to grow. Buffers of rounded size: the
    next scene's program is then compiled already."""
    config = stages.refine
    for _ in range(config.duplicates):
        scene = merge_duplicates(scene)
    if config.needless > 0 or 0 < config.most < int(scene.alive.sum()):
        chosen = np.unique(np.linspace(0, len(views.rgb) - 1, WEIGHED).astype(int))
        weight = contribution(scene, [camera_of(views, int(i)) for i in chosen], config=stages.rasterize)
        scene = prune_within(scene, weight, config.needless)
        scene = prune_to(scene, weight, config.most) if config.most else scene
    scene = compact(scene, spare=config.spare)
    scene = with_capacity(scene, bucket(scene.alive.shape[0]))
    if 0 < config.most < scene.alive.shape[0]:
        scene = jax.tree.map(lambda x: x[: config.most], scene)  # the living come first
    return scene


def refine_scene(
    scene: Gaussians, views: Views, panorama: Panorama, key: jax.Array, *, stages: Stages, **options
) -> tuple[Gaussians, dict]:
    """The refined scene and its curves (paper Sec. 3.3); `options` are `refine`'s."""
    scene = _needed(scene, views, stages)
    if stages.refine.keep_observed:
        options["fixed"] = on_observed(panorama, scene.means)
    extent = scene_extent(panorama)
    if stages.refine.devices != 1:
        options["run"] = steps_over(data_mesh(stages.refine.devices))
    return refine(scene, views, extent, key, config=stages.refine, raster=stages.rasterize, **options)
