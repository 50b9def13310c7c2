"""What is known before anything is guessed: the distances, the lifted scene, the paths, the room's shell."""

import jax.numpy as jnp
from flax import struct

from rein3d_jax.conventions import EYE_HEIGHT
from rein3d_jax.depth.complete import complete_distance
from rein3d_jax.depth.estimate import estimate_distance
from rein3d_jax.depth.room_shell import fit_room_shell, shell_distance
from rein3d_jax.depth.shell_from_distance import shell_from_distance
from rein3d_jax.errors import InputError
from rein3d_jax.explore.trajectories import Trajectories, radial_trajectories
from rein3d_jax.lift import LiftConfig, lift_adaptively
from rein3d_jax.pipeline.buffer import allotted
from rein3d_jax.pipeline.stages import Stages, origin_pose
from rein3d_jax.restore import Background, RestoreConfig, background_of
from rein3d_jax.scene import Gaussians, Panorama


@struct.dataclass
class Survey:
    """What exploring starts from."""

    panorama: Panorama  # its distance complete
    coarse: Gaussians  # the panorama, lifted
    trajectories: Trajectories  # where a camera may go


def with_distance(
    panorama: Panorama, stages: Stages, network: dict | None = None, *, camera_height: float = EYE_HEIGHT
) -> tuple[Panorama, bool]:
    """The panorama with a distance everywhere, and whether it was estimated: where none is known, `estimate_distance`
    says it, by the depth network's parameters (`read_depth_network`'s), or an empty box is fitted to the picture's
    edges, as stages.depth.method wants, for a camera `camera_height` metres above the floor; then what is unknown is
    completed, and `valid` still says what was known."""
    estimated = not bool(panorama.valid.any())
    if estimated and stages.depth.method == "shell":
        box, _ = fit_room_shell(panorama.rgb, camera_height, config=stages.shell)
        distance = shell_distance(box, *panorama.valid.shape)
        return Panorama(panorama.rgb, distance, jnp.ones(distance.shape, bool), jnp.zeros(distance.shape)), True
    if estimated:
        if network is None:
            mend = "with_distance(panorama, stages, read_depth_network())"
            raise InputError(f'depth.method "network" needs the trained network: {mend}')
        found = estimate_distance(panorama.rgb, network, camera_height, shell=stages.shell)
        panorama = Panorama(panorama.rgb, found.distance, found.known, found.doubt)
    whole = bool(panorama.valid.all())
    distance = panorama.distance if whole else complete_distance(panorama, config=stages.depth)
    doubt = jnp.zeros(distance.shape) if panorama.doubt is None else panorama.doubt
    return panorama.replace(distance=distance, doubt=doubt), estimated


def survey(panorama: Panorama, stages: Stages) -> Survey:
    """The panorama (its distance complete) lifted, and where a camera may go in it."""
    return Survey(panorama, lift_scene(panorama, stages.lift), radial_trajectories(panorama, config=stages.explore))


def lift_scene(panorama: Panorama, config: LiftConfig) -> Gaussians:
    """The coarse scene."""
    everywhere = jnp.ones(panorama.distance.shape, bool)
    placed = panorama.replace(valid=everywhere)  # an unknown distance was completed; its colour is known
    scene = lift_adaptively(placed, origin_pose(), everywhere, config=config)
    return allotted(scene, config)


def room_background(panorama: Panorama, config: RestoreConfig) -> Background | None:
    """The room's shell with its colours, or None where what was seen is no box."""
    shell, support = shell_from_distance(panorama)
    return background_of(panorama, shell) if float(support) >= config.shell_support else None
