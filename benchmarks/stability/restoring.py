"""Regimes of restoring: masks of what is missing that are too small or too large, in views of the lifted scene alone.

Negative widths leave spoiled rims in, positive ones take good pixels away. Restored by the packaged network, beside our
classical fill and OpenCV's two."""

import jax
import jax.numpy as jnp

from benchmarks.stability.case import ROWS, view_figures
from benchmarks.stability.given_distance import furnished
from benchmarks.stability.methods import completed, small_restorer, stages
from benchmarks.stability.regime import OURS, WHOLE, Figures, Regime
from rein3d_jax.geometry.morphology import window_sum
from rein3d_jax.pipeline.stages import render_video
from rein3d_jax.pipeline.survey import lift_scene, room_background
from rein3d_jax.restore.background import restore_background
from rein3d_jax.restore.fills import restore_navier_stokes, restore_telea
from rein3d_jax.scene import Video

OBSERVED = 0.5


def _masked(width: float, seed: int) -> dict[str, Figures]:
    """Holes that are `width` pixels wider on all sides than they are."""
    case, config = furnished(seed), stages()
    placed = completed(case.given)
    background = room_background(placed, config.restore)
    poses = jnp.stack([case.pose_of(view) for view in case.views])
    video, _ = render_video(lift_scene(placed, config.lift), poses, ROWS, config=config.rasterize)
    masked = _widened(video, int(width))
    found = {
        OURS: small_restorer(background)(masked, jax.random.key(0)),
        "ours, no network": restore_background(masked, observed=OBSERVED, background=background),
        "telea": restore_telea(masked, observed=OBSERVED),
        "navier-stokes": restore_navier_stokes(masked, observed=OBSERVED),
    }
    return {name: _figures(restored, case.views) for name, restored in found.items()}


def _widened(video: Video, width: int) -> Video:
    holes = video.alpha < OBSERVED
    grown = jnp.stack([_grown(hole if width > 0 else ~hole, abs(width)) for hole in holes])
    alpha = jnp.where(grown, 0.0, 1.0) if width > 0 else jnp.where(grown, 1.0, 0.0)
    return video.replace(alpha=alpha if width else video.alpha)


def _grown(mask: jax.Array, radius: int) -> jax.Array:
    return window_sum(mask.astype(jnp.float32), radius) > 0


def _figures(restored: Video, views: list) -> Figures:
    shown = jnp.ones(restored.alpha.shape[1:])
    rows = [
        view_figures(view, rgb, shown, distance, jnp.zeros(3))
        for view, rgb, distance in zip(views, restored.rgb, restored.distance, strict=True)
    ]
    return {"psnr": sum(row["psnr"] for row in rows) / len(rows)}


REGIMES = (
    Regime("masks of holes", "rims that stay, or good pixels made up", "pixels that a hole is wider",
           (-4, -2, -1, 0, 1, 2, 4), 0, WHOLE, _masked, rows="22"),
)  # fmt: skip
