"""The refinement between two steps: enough to go on to the same bytes, and what has been seen on the way."""

import jax
import numpy as np
from flax import struct

from rein3d_jax.rasterize import RasterizeConfig, allocate
from rein3d_jax.refine.config import RefineConfig
from rein3d_jax.refine.state import RefineState, Still, initial_state
from rein3d_jax.refine.views import Views, camera_of
from rein3d_jax.scene import Gaussians

_ALLOCATED_BY = 24  # views, evenly through the list; a greedier one grows the buffers when it comes


@struct.dataclass
class Curves:
    """What was measured, as rows of (step, value), and what went wrong, as totals."""

    loss: np.ndarray  # (k, 2) of each step
    psnr: np.ndarray  # (k, 2) dB at the held-out views
    count: np.ndarray  # (k, 2) Gaussians, at each held-out evaluation
    overflow: np.ndarray  # () Gaussians that densification had no slot for
    reallocated: np.ndarray  # () times that the rasterizer's buffers grew
    skipped: np.ndarray  # () steps whose gradient was not finite


@struct.dataclass
class Snapshot:
    """The refinement's state."""

    state: RefineState
    buffers: jax.Array  # (4,) the rasterizer's sizes: sums over buffers of another size round otherwise
    curves: Curves
    stopped: str  # why it ended; "" while it goes on

    @property
    def scene(self) -> Gaussians:
        """The Gaussians as they are now."""
        return self.state.scene

    @property
    def step(self) -> int:
        """Steps taken."""
        return int(self.state.step)

    @property
    def evaluated(self) -> bool:
        """Whether the held-out views have been evaluated at this very step."""
        return len(self.curves.psnr) > 0 and self.curves.psnr[-1, 0] == self.step


def first_snapshot(
    gaussians: Gaussians,
    views: Views | None,
    *,
    extent: float,
    config: RefineConfig,
    raster: RasterizeConfig,
    still: Still | None = None,
) -> Snapshot:
    """The refinement of `gaussians` before its first step; without steps no `views` are looked at. `extent` is the
    scene's size in metres; `still` is what stays as it is, or None."""
    state = initial_state(gaussians, config, extent=extent, still=still)
    buffers = np.zeros(4, np.int32)
    if config.steps:  # without them nothing is rendered
        chosen = np.unique(np.linspace(0, views.rgb.shape[0] - 1, _ALLOCATED_BY).astype(int))
        cameras = [camera_of(views, int(i)) for i in chosen]
        buffers = np.array(allocate(state.shown(state.parameters), cameras, config=raster, slack=1.25), np.int32)
    rows, total = np.zeros((0, 2)), np.zeros(())
    return Snapshot(state, jax.device_put(buffers), Curves(rows, rows, rows, total, total, total), "")


def blank_snapshot(config: RefineConfig) -> Snapshot:
    """A snapshot's structure and dtypes, with which to read one back."""
    one, three = np.ones(1, np.float32), np.zeros((1, 3), np.float32)
    scene = Gaussians(three, three, np.eye(1, 4, dtype=np.float32), one, three[:, None], one > 0)
    state = initial_state(scene, config, extent=1.0)
    return Snapshot(state, jax.device_put(np.zeros(4, np.int32)), Curves(*[np.zeros(0)] * 6), "")
