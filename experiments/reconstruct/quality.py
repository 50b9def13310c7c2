"""A scene against ground-truth views: the numbers of metrics.json."""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

from experiments.reconstruct.inputs import View
from rein3d_jax.evaluate.metrics import psnr, ssim
from rein3d_jax.rasterize import RasterizeConfig, allocate, render
from rein3d_jax.scene import Gaussians

AT_ORIGIN = 1e-3  # metres; a view from the panorama's own place is no novel view


def is_novel(view: View) -> bool:
    """Taken from elsewhere than the input panorama."""
    return float(jnp.linalg.norm(view.camera.world_from_camera[:3, 3])) > AT_ORIGIN


def render_views(scenes: Sequence[Gaussians], views: list[View], backdrop: jax.Array, *, config: RasterizeConfig):
    """Of each scene the (h, w, 3) pictures over the colour `backdrop` (3,), in the buffers that the last one needs."""
    buffers = allocate(scenes[-1], [view.camera for view in views], config=config) if views else None
    found = []
    for scene in scenes:
        found.append([])
        for view in views:
            frame, buffers = render(scene, view.camera, config=config, buffers=buffers)
            found[-1].append(np.asarray(frame.over(backdrop)))
    return found


def quality(pictures: list[np.ndarray], views: list[View]) -> dict:
    """Means over the novel views, PSNR in dB, and over those at the origin apart: there nothing was hidden."""
    rows = [(is_novel(v), float(psnr(p, v.rgb)), float(ssim(p, v.rgb))) for p, v in zip(pictures, views, strict=True)]
    novel = [row[1:] for row in rows if row[0]]
    origin = [row[1:] for row in rows if not row[0]]
    result = dict(zip(("psnr", "ssim"), _mean(novel), strict=True)) | {"views": len(novel)}
    if origin:
        result["origin"] = dict(zip(("psnr", "ssim"), _mean(origin), strict=True))
    return result


def _mean(rows):
    # An exact picture has infinite PSNR, which JSON cannot say; 100 dB is beyond any 8-bit picture.
    return [round(float(np.mean(np.minimum(column, 100.0))), 4) for column in zip(*rows, strict=True)] or [0.0, 0.0]
