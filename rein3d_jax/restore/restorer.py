"""The protocol that every restorer implements, and the table that names them."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import jax

from rein3d_jax.errors import InputError
from rein3d_jax.restore.background import Background, restore_background
from rein3d_jax.restore.fills import restore_navier_stokes, restore_none, restore_telea
from rein3d_jax.restore.learned.restore import restore_learned
from rein3d_jax.restore.learned.sample import Learned
from rein3d_jax.restore.wan.config import WanConfig
from rein3d_jax.restore.wan.restore import SampleConfig, WanParams, restore_video
from rein3d_jax.scene import Video

Restorer = Callable[[Video, jax.Array], Video]
Network = Learned | WanParams

FILLS = {
    "background": restore_background,
    "telea": restore_telea,
    "navier_stokes": restore_navier_stokes,
    "none": restore_none,
}
LEARNED, DIFFUSION = "learned", "diffusion"
METHODS = (*FILLS, LEARNED, DIFFUSION)


@dataclass(frozen=True)
class DiffusionConfig:
    network: WanConfig = WanConfig()
    sample: SampleConfig = SampleConfig()


@dataclass(frozen=True)
class RestoreConfig:
    method: str = "background"  # background | telea | navier_stokes | none | learned | diffusion
    weights: str | None = None  # learned: an NPZ file, none for the packaged one; diffusion: a folder
    sequential: bool = True  # later trajectories see what earlier ones restored; false is the paper's order
    fuse_every: int = 2  # frames from one that is lifted into the scene to the next, counted from the farthest
    height: int = 128  # rows of the restored panoramas; the width is twice that
    shell_support: float = 0.3  # share of the panorama that must lie on a box before holes are filled with its faces
    observed: float = 0.5  # alpha from which a pixel counts as observed
    diffusion: DiffusionConfig = DiffusionConfig()

    def __post_init__(self):
        if self.method not in METHODS:
            raise InputError(f'restore.method "{self.method}" is unknown; choose one of {", ".join(METHODS)}')
        if self.height % 16 or self.height < 32:
            raise InputError(f"restore.height {self.height} must be a multiple of 16 and at least 32")
        if self.fuse_every < 1:
            raise InputError(f"restore.fuse_every {self.fuse_every} must be at least 1")
        if not 0 < self.observed < 1:
            raise InputError(f"restore.observed {self.observed} must lie between 0 and 1")


def restorer(config: RestoreConfig, background: Background | None = None, network: Network | None = None) -> Restorer:
    """The restorer that `config` names. The fills use no randomness; the key is for those that sample.

    `background` is the room's shell with its colours, where it is known; OpenCV's fills make no use of it. `network` is
    what `learned` and `diffusion` were trained to. Raises InputError without it.
    """
    knows = {"observed": config.observed, "background": background}
    if config.method in FILLS:
        return lambda video, key: FILLS[config.method](video, **knows)
    if network is None:
        raise InputError(f'restore.method "{config.method}" needs a trained network: read one (restore.weights)')
    if config.method == LEARNED:
        return partial(restore_learned, learned=network, **knows)
    diffusion = config.diffusion
    return partial(restore_video, params=network, config=diffusion.network, sampling=diffusion.sample, **knows)
