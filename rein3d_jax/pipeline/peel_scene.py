"""The coarse scene with the layers behind it: the room behind what stands in it, the outside behind the room."""

import dataclasses

import jax

from rein3d_jax.lift import lift_adaptively, merge, with_capacity
from rein3d_jax.peel import behind_things, outside_of, without_things
from rein3d_jax.pipeline.stages import Stages, origin_pose
from rein3d_jax.pipeline.survey import Survey
from rein3d_jax.rasterize import bucket
from rein3d_jax.restore import Background, Restorer
from rein3d_jax.scene import Gaussians, Panorama


def peel_scene(
    known: Survey, background: Background | None, restore: Restorer, key: jax.Array, *, stages: Stages
) -> Gaussians:
    """The coarse scene of `known` and, in free slots, the layers that stages.peel names. The room's is made up by
    `restore`, not upsampled, and needs its `background`: where what was seen is no box, there is none."""
    scene = known.coarse
    if stages.peel.room and background is not None and stages.restore.method != "none":
        taken = without_things(known.panorama, background.shell, origin_pose(), rows=stages.restore.height)
        layer, hidden = behind_things(taken, restore(taken, key), background.shell)
        scene = _with_layer(scene, layer, hidden, stages)
    if stages.peel.outside:
        outside = outside_of(known.panorama, known.trajectories.positions.reshape(-1, 3))
        if outside.there:
            scene = _with_layer(scene, outside.panorama, outside.shown, stages)
    return scene


def _with_layer(scene: Gaussians, layer: Panorama, where: jax.Array, stages: Stages) -> Gaussians:
    # A guess has no edges to mend, and a layer as many Gaussians as its content needs.
    config = dataclasses.replace(stages.lift, snap_edges=False)
    new = lift_adaptively(layer, origin_pose(), where, config=config)
    missing = int(new.alive.sum() - (~scene.alive).sum())
    if missing > 0:
        scene = with_capacity(scene, bucket(scene.alive.shape[0] + missing))
    return merge(scene, new)[0]
