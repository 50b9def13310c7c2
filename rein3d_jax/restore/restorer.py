"""The protocol that every restorer implements, its settings, and the table that names them."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import jax

from rein3d_jax.errors import InputError
from rein3d_jax.restore.background import Background, restore_background
from rein3d_jax.restore.fills import restore_navier_stokes, restore_none, restore_telea
from rein3d_jax.restore.learned.restore import restore_learned
from rein3d_jax.restore.learned.sample import Learned
from rein3d_jax.restore.wan.restore import DiffusionConfig, WanParams, restore_video
from rein3d_jax.scene import Video
from rein3d_jax.settings import Settings, setting

Restorer = Callable[[Video, jax.Array], Video]
TrainedNetwork = Learned | WanParams

FILLS = {
    "background": restore_background,
    "telea": restore_telea,
    "navier_stokes": restore_navier_stokes,
    "none": restore_none,
}
LEARNED, DIFFUSION = "learned", "diffusion"
METHODS = (*FILLS, LEARNED, DIFFUSION)


@dataclass(frozen=True)
class RestoreConfig(Settings):
    """How what the input did not see is made up, frame by frame of a trajectory."""

    method: str = setting("background", "fill of holes, or trained network", among=METHODS)
    weights: str | None = setting(None, "of learned: an NPZ file, none for the packaged one; of diffusion: a folder")
    sequential: bool = setting(True, "later trajectories see what earlier ones restored; false is the paper's order")
    fuse_every: int = setting(
        2, "from one frame lifted into the scene to the next; 0: none is", within="[0, inf)", unit="frames"
    )
    height: int = setting(128, "of the restored panoramas, a multiple of 16", within="[32, inf)", unit="rows")
    shell_support: float = setting(0.3, "share on a box, below which holes show no box", within="[0, inf)")
    observed: float = setting(0.5, "alpha from which a pixel counts as observed", within="(0, 1)")
    diffusion: DiffusionConfig = DiffusionConfig()

    def __post_init__(self):
        super().__post_init__()
        if self.height % 16:
            raise InputError(f"height must be a multiple of 16, not {self.height}")


def restorer(
    config: RestoreConfig, background: Background | None = None, network: TrainedNetwork | None = None
) -> Restorer:
    """The restorer that `config` names. The fills use no randomness; the key is for those that sample.

    `background` is the room's shell with its colours, where it is known; OpenCV's fills make no use of it. `network` is
    what `learned` and `diffusion` were trained to. Raises InputError without it.
    """
    shared = {"observed": config.observed, "background": background}
    if config.method in FILLS:
        return lambda video, key: FILLS[config.method](video, **shared)
    if network is None:
        raise InputError(f'restore.method "{config.method}" needs a trained network: read one (restore.weights)')
    if config.method == LEARNED:
        return partial(restore_learned, learned=network, **shared)
    return partial(restore_video, params=network, config=config.diffusion, **shared)
