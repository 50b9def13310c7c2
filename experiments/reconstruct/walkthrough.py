"""The page on which one walks through a finished scene."""

import jax
import numpy as np

from experiments.reconstruct.story import Run, plan
from rein3d_jax.io.pictures.image import encode_jpeg
from rein3d_jax.io.splats.spz import encode_spz
from rein3d_jax.report.viewer import render_viewer
from rein3d_jax.scene import Gaussians


def walkthrough(run: Run, coarse: Gaussians, refined: Gaussians, backdrop: jax.Array, filter_variance: float) -> str:
    """viewer.html: the input panorama, and both scenes as they come back from SPZ. `backdrop`, sRGB (3,), stands where
    no splat is; `filter_variance` is the rasterizer's, pixels^2. Raises InputError where SPZ cannot hold a scene."""
    scenes = {"Coarse": encode_spz(coarse, "the lifted scene"), "Refined": encode_spz(refined, "the refined scene")}
    panorama = encode_jpeg(np.asarray(run.panorama.rgb))
    look = {"backdrop": np.asarray(backdrop), "filter_variance": filter_variance}
    return render_viewer(scenes, panorama, plan(run.trajectories, run.explore, run.views), **look)
