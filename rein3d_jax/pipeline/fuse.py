"""A restored video into the scene: its guesses moved to where the input could not have seen them, and lifted."""

import dataclasses

import jax.numpy as jnp
from flax import struct

from rein3d_jax.explore.hidden import hidden_distance
from rein3d_jax.geometry.poses import equirectangular_camera
from rein3d_jax.geometry.sphere import rays_of_pose
from rein3d_jax.lift import lift
from rein3d_jax.pipeline.buffer import joined_in
from rein3d_jax.pipeline.stages import Stages
from rein3d_jax.rasterize import Buffers, render
from rein3d_jax.scene import Gaussians, Panorama, Video

_MOVED = 1e-3  # relative: more than rounding, less than the least move of hidden_distance


@struct.dataclass
class Fused:
    """The scene with what was guessed."""

    scene: Gaussians
    overflow: int  # Gaussians that found no slot
    buffers: Buffers = struct.field(pytree_node=False)  # the rasterizer's, as they have grown


def fuse_guesses(start: Fused, degraded: Video, restored: Video, panorama: Panorama, stages: Stages) -> Fused:
    """Lift a restored video into what the scene leaves open, farthest frame first: it opens the largest holes, and the
    nearer ones then see them closed. `degraded` is the video before restoring and upsampling, `panorama` the input."""
    scene, overflow, buffers, last = start.scene, start.overflow, start.buffers, restored.rgb.shape[0] - 1
    # Edges were snapped when the input was lifted; a guess has none to mend.
    config = dataclasses.replace(stages.lift, snap_edges=False)
    # One that had to move lies on no surface that anybody saw: stretched along its neighbours it made fog.
    round_ones = dataclasses.replace(config, steepest=0.0)
    for index in range(last, 0, -stages.restore.fuse_every):
        camera = equirectangular_camera(restored.world_from_camera[index], restored.rgb.shape[1])
        alpha = degraded.alpha[index]
        grown = index < last or not stages.restore.sequential  # the scene has, since the video was rendered
        if grown or alpha.shape != restored.alpha.shape[1:]:
            frame, buffers = render(scene, camera, config=stages.rasterize, buffers=buffers)
            alpha = frame.alpha
        guess = _guess(restored, index, panorama)
        hole = (alpha < stages.restore.observed) & guess.valid
        moved = jnp.abs(guess.distance - restored.distance[index]) > _MOVED * guess.distance
        for part, config_of_part in ((hole & ~moved, config), (hole & moved, round_ones)):
            new = lift(guess, camera.world_from_camera, part, config=config_of_part)
            scene, dropped = joined_in(scene, new, grow=not stages.lift.capacity)
            overflow += dropped
    return Fused(scene, overflow, buffers)


def _guess(video: Video, index: int, panorama: Panorama) -> Panorama:
    """Frame `index` with its guesses moved into unseen space."""
    rgb, distance, pose = (x[index] for x in (video.rgb, video.distance, video.world_from_camera))
    place = hidden_distance(panorama, pose[:3, 3], rays_of_pose(pose, *distance.shape), distance)
    return Panorama(rgb, place, place > 0)
