"""One panorama in, one scene out: all stages joined, pure of files."""

from collections import deque

import jax
from flax import struct

from rein3d_jax.conventions import EYE_HEIGHT
from rein3d_jax.explore.trajectories import Trajectories
from rein3d_jax.pipeline.explore_and_restore import Explored, explore_and_restore, lightly
from rein3d_jax.pipeline.peel_scene import peel_scene
from rein3d_jax.pipeline.refine_scene import collect_views, refine_scene, where_it_pays
from rein3d_jax.pipeline.stages import Stages
from rein3d_jax.pipeline.survey import Survey, room_background, survey, with_distance
from rein3d_jax.rasterize import Buffers
from rein3d_jax.refine import Curves
from rein3d_jax.restore import TrainedNetwork, restorer
from rein3d_jax.scene import Gaussians, Panorama, Video
from rein3d_jax.upsample import then_upsample

ALL_PATHS = "all paths taken"


@struct.dataclass
class Decisions:
    """Why the stages did as much as they did."""

    revealed: tuple[float, ...]  # share of the sphere that was open at each path's end, before it was restored
    explored: str  # why exploring ended
    refined: str  # why refining ended
    overflow: int  # Gaussians that exploring found no slot for


@struct.dataclass
class Reconstruction:
    """A scene, and what it was made from. It stands here, not in scene.py, since its parts are several stages'."""

    panorama: Panorama  # its distance complete
    coarse: Gaussians  # the panorama, lifted
    trajectories: Trajectories
    videos: tuple[Video, ...]  # the restored panoramas along each trajectory
    scene: Gaussians
    curves: Curves
    decisions: Decisions
    buffers: Buffers = struct.field(pytree_node=False)  # the rasterizer's for panoramas of the scene


def reconstruct(
    panorama: Panorama,
    key: jax.Array,
    *,
    stages: Stages = Stages(),
    network: TrainedNetwork | None = None,
    upsampler: dict | None = None,
    camera_height: float = EYE_HEIGHT,
) -> Reconstruction:
    """The scene of a panorama (h, 2 h): lifted, peeled, explored, restored and refined (paper Sec. 3).

    Distances that are not `valid` are completed. Where none is, `with_distance` estimates them beforehand; with
    stages.depth.method "shell" an empty box is fitted here, for a camera `camera_height` metres above the floor.
    `network` is the trained restorer, where stages.restore names one, `upsampler` the parameters of the network where
    stages.upsample names it. Runs outside jit; every stage in it is compiled.
    The same key gives the same bytes.
    """
    panorama, _ = with_distance(panorama, stages, camera_height=camera_height)
    known = survey(panorama, stages)
    background = room_background(panorama, stages.restore)
    restore = restorer(stages.restore, background, network)
    explore_key, refine_key, peel_key = (jax.random.fold_in(key, i) for i in range(3))
    peeled = known.replace(coarse=peel_scene(known, background, restore, peel_key, stages=stages))
    restore = then_upsample(restore, panorama, upsampler, config=stages.upsample)
    explored = lightly(explore_and_restore(peeled, restore, explore_key, stages=stages))
    videos = [state.video for state in explored]
    stages = where_it_pays(stages, videos)
    views = collect_views(panorama, videos, stages=stages)
    (last,) = deque(refine_scene(explored[-1].scene, views, panorama, refine_key, stages=stages), maxlen=1)
    return joined(known, explored, (last.scene, last.curves, last.stopped))


def joined(known: Survey, explored: list[Explored], refined: tuple[Gaussians, Curves, str]) -> Reconstruction:
    """The reconstruction of what each stage gave: the states after each path; the refined scene, its curves and why
    refining ended."""
    scene, curves, stopped = refined
    revealed = tuple(round(float(state.revealed), 4) for state in explored)
    decisions = Decisions(revealed, ALL_PATHS, stopped, int(explored[-1].overflow))
    videos, buffers = tuple(state.video for state in explored), Buffers(*map(int, explored[-1].buffers))
    return Reconstruction(known.panorama, known.coarse, known.trajectories, videos, scene, curves, decisions, buffers)
