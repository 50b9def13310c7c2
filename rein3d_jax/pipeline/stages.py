"""The stages' settings together, and what all stages share: the input's pose and panoramas rendered along poses."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp

from rein3d_jax.depth.estimate import DepthConfig
from rein3d_jax.depth.room_shell import RoomShellConfig
from rein3d_jax.explore.profile import ExploreConfig
from rein3d_jax.geometry.poses import equirectangular_camera, rigid
from rein3d_jax.geometry.sphere import world_from_camera_axes
from rein3d_jax.lift import LiftConfig
from rein3d_jax.peel import PeelConfig
from rein3d_jax.rasterize import Buffers, RasterizeConfig, render
from rein3d_jax.refine import RefineConfig
from rein3d_jax.restore import RestoreConfig
from rein3d_jax.scene import Gaussians, Video
from rein3d_jax.settings import Settings
from rein3d_jax.upsample import UpsampleConfig


@dataclass(frozen=True)
class Stages(Settings):
    """One config for each stage."""

    shell: RoomShellConfig = RoomShellConfig()  # where no distance is given
    depth: DepthConfig = DepthConfig()
    lift: LiftConfig = LiftConfig()
    explore: ExploreConfig = ExploreConfig()
    peel: PeelConfig = PeelConfig()
    rasterize: RasterizeConfig = RasterizeConfig()
    restore: RestoreConfig = RestoreConfig()
    upsample: UpsampleConfig = UpsampleConfig()
    refine: RefineConfig = RefineConfig()


@jax.jit
def level_pose(position: jax.Array) -> jax.Array:
    """world_from_camera (..., 4, 4) of a panorama at (..., 3) metres that is oriented as the input is: along +X."""
    return rigid(jnp.broadcast_to(world_from_camera_axes(), (*position.shape[:-1], 3, 3)), position)


def origin_pose() -> jax.Array:
    """world_from_camera (4, 4) of the input panorama."""
    return level_pose(jnp.zeros(3))


def render_video(
    gaussians: Gaussians, poses: jax.Array, height: int, *, config: RasterizeConfig, buffers: Buffers | None = None
) -> tuple[Video, Buffers]:
    """The panoramas along `poses` (t, 4, 4), colour un-premultiplied, and the buffers to reuse."""
    frames = []
    for pose in poses:
        camera = equirectangular_camera(pose, height)
        frame, buffers = render(gaussians, camera, config=config, buffers=buffers)
        frames.append((_straight(frame.rgb, frame.alpha), frame.alpha, frame.distance))
    rgb, alpha, distance = (jnp.stack(part) for part in zip(*frames, strict=True))
    return Video(rgb, alpha, distance, poses), buffers


@jax.jit
def _straight(rgb: jax.Array, alpha: jax.Array) -> jax.Array:
    """Colours (h, w, 3) in [0, 1], no longer premultiplied."""
    return jnp.clip(rgb / jnp.maximum(alpha, 1e-6)[..., None], 0, 1)
