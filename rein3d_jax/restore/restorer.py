"""The protocol that every restorer implements, and the table that names them."""

from collections.abc import Callable
from dataclasses import dataclass

import jax

from rein3d_jax.errors import InputError
from rein3d_jax.restore.background import Background, restore_background
from rein3d_jax.restore.fills import restore_navier_stokes, restore_none, restore_telea
from rein3d_jax.scene import Video

Restorer = Callable[[Video, jax.Array], Video]


@dataclass(frozen=True)
class RestoreConfig:
    method: str = "background"  # background | telea | navier_stokes | none
    sequential: bool = True  # later trajectories see what earlier ones restored; false is the paper's order
    fuse_every: int = 2  # frames from one that is lifted into the scene to the next, counted from the farthest
    height: int = 128  # rows of the restored panoramas; the width is twice that
    shell_support: float = 0.3  # share of the panorama that must lie on a box before holes are filled with its faces
    observed: float = 0.5  # alpha from which a pixel counts as observed

    def __post_init__(self):
        if self.method not in METHODS:
            raise InputError(f'restore.method "{self.method}" is unknown; choose one of {", ".join(METHODS)}')
        if self.height % 16 or self.height < 32:
            raise InputError(f"restore.height {self.height} must be a multiple of 16 and at least 32")
        if self.fuse_every < 1:
            raise InputError(f"restore.fuse_every {self.fuse_every} must be at least 1")
        if not 0 < self.observed < 1:
            raise InputError(f"restore.observed {self.observed} must lie between 0 and 1")


METHODS = {
    "background": restore_background,
    "telea": restore_telea,
    "navier_stokes": restore_navier_stokes,
    "none": restore_none,
}


def restorer(config: RestoreConfig, background: Background | None = None) -> Restorer:
    """The restorer that `config` names. The fills use no randomness; the key is for those that sample.

    `background` is the room's shell with its colours, where it is known; only the background fill makes use of it.
    """
    method = METHODS[config.method]
    return lambda video, key: method(video, observed=config.observed, background=background)
