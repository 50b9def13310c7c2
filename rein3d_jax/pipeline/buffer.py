"""The scene's buffer while it grows. Its sizes are rounded, so that near ones share compiled programs; what is rendered
costs by the slot, dead or alive."""

from rein3d_jax.lift import LiftConfig, compact, merge, with_capacity
from rein3d_jax.rasterize import bucket
from rein3d_jax.scene import Gaussians


def allotted(scene: Gaussians, config: LiftConfig) -> Gaussians:
    """The lifted scene in config.capacity slots or, where that is 0, in as many as it fills, rounded up. Raises
    InputError where it does not fit. Outside jit."""
    if config.capacity:
        return with_capacity(scene, config.capacity)
    return compact(scene, capacity=bucket(int(scene.alive.sum())))


def joined_in(scene: Gaussians, new: Gaussians, *, grow: bool) -> tuple[Gaussians, int]:
    """The scene with the living of `new`, and how many found no slot: none, where the buffer may `grow`. Outside
    jit."""
    missing = int(new.alive.sum() - (~scene.alive).sum())
    if missing > 0 and grow:
        scene = with_capacity(scene, bucket(scene.alive.shape[0] + missing))
    scene, dropped = merge(scene, new)
    return scene, int(dropped)
