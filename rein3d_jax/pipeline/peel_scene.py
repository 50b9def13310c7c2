"""The coarse scene with the layers behind it: the room behind what stands in it, the outside behind the room, and a
lining right behind sharp surfaces."""

import dataclasses

import jax

from rein3d_jax.lift import lift, lift_adaptively, lining
from rein3d_jax.peel import behind_things, outside_of, without_things
from rein3d_jax.pipeline.buffer import joined_in
from rein3d_jax.pipeline.stages import Stages, origin_pose
from rein3d_jax.pipeline.survey import Survey
from rein3d_jax.restore import Background, Restorer
from rein3d_jax.scene import Gaussians

# Pixels that a Gaussian of the layer spans at most, where it has not the panorama's size and the lift's own programs do
# not fit it: with 16 it has 1 % fewer, and compiles thrice as long.
_LEAF = 4


def peel_scene(
    known: Survey, background: Background | None, restore: Restorer, key: jax.Array, *, stages: Stages
) -> Gaussians:
    """The coarse scene of `known` and the layers that stages.peel names. The room's is made up by
    `restore`, not upsampled, and needs its `background`: where what was seen is no box, there is none."""
    scene, leaf = known.coarse, stages.lift.max_leaf_side
    if stages.restore.height != len(known.panorama.rgb):
        leaf = min(leaf, _LEAF)
    # A guess has no edges to mend.
    config = dataclasses.replace(stages.lift, snap_edges=False, max_leaf_side=leaf)
    if stages.peel.room and background is not None and stages.restore.method != "none":
        taken = without_things(known.panorama, background.shell, origin_pose(), rows=stages.restore.height)
        _, hidden = behind_things(taken, taken, background.shell)
        if hidden.any():  # in an empty room nothing is to be made up
            layer, hidden = behind_things(taken, restore(taken, key), background.shell)
            new = lift_adaptively(layer, origin_pose(), hidden, config=config)
            scene, _ = joined_in(scene, new, grow=True)
    if stages.peel.outside and not known.panorama.valid.all():  # windows have no distance
        outside = outside_of(known.panorama, known.trajectories.positions.reshape(-1, 3))
        if outside.there:
            new = lift(outside.panorama, origin_pose(), outside.shown, config=config)
            scene, _ = joined_in(scene, new, grow=True)
    if stages.peel.lining:
        new = lining(known.panorama, origin_pose(), config=config)
        scene, _ = joined_in(scene, new, grow=True)
    return scene
