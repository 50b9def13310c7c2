"""What is known before anything is guessed: the distances, the lifted scene, the paths, the room's shell."""

import jax.numpy as jnp
from flax import struct

from rein3d_jax.depth.complete import complete_distance
from rein3d_jax.depth.room_shell import fit_room_shell, shell_distance
from rein3d_jax.depth.shell_from_distance import shell_from_distance
from rein3d_jax.explore.trajectories import Trajectories, radial_trajectories
from rein3d_jax.lift import LiftConfig, lift_adaptively, with_capacity
from rein3d_jax.pipeline.stages import Stages, origin_pose
from rein3d_jax.restore import Background, RestoreConfig, background_of
from rein3d_jax.scene import Gaussians, Panorama


@struct.dataclass
class Survey:
    """What exploring starts from."""

    panorama: Panorama  # its distance complete
    coarse: Gaussians  # the panorama, lifted
    trajectories: Trajectories  # where a camera may go


def with_distance(panorama: Panorama, stages: Stages) -> tuple[Panorama, bool]:
    """The panorama with a distance everywhere, and whether it was fitted: where none is known, an empty box is fitted
    to the picture's edges; else what is unknown is completed, and `valid` still says what was known."""
    if not bool(panorama.valid.any()):
        box, _ = fit_room_shell(panorama.rgb, config=stages.shell)
        distance = shell_distance(box, *panorama.valid.shape)
        return Panorama(panorama.rgb, distance, jnp.ones(distance.shape, bool)), True
    distance = complete_distance(panorama.distance, panorama.valid, config=stages.depth)
    return panorama.replace(distance=distance), False


def survey(panorama: Panorama, stages: Stages) -> Survey:
    """The panorama (its distance complete) lifted, and where a camera may go in it."""
    return Survey(panorama, lift_scene(panorama, stages.lift), radial_trajectories(panorama, config=stages.explore))


def lift_scene(panorama: Panorama, config: LiftConfig) -> Gaussians:
    """The coarse scene, in a buffer with room for what exploring will add."""
    everywhere = jnp.ones(panorama.distance.shape, bool)
    placed = panorama.replace(valid=everywhere)  # an unknown distance was completed; its colour is known
    scene = lift_adaptively(placed, origin_pose(), everywhere, config=config)
    return with_capacity(scene, config.capacity or scene.alive.size + everywhere.size)


def room_background(panorama: Panorama, config: RestoreConfig) -> Background | None:
    """The room's shell with its colours, or None where what was seen is no box."""
    shell, support = shell_from_distance(panorama)
    return background_of(panorama, shell) if float(support) >= config.shell_support else None
