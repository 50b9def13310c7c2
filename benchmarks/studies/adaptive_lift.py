"""PSNR at novel views against Gaussians: the adaptive lift at several shares, beside one Gaussian a pixel.

Lifted only, not refined. Means over rooms, with standard errors.

    python -m benchmarks.studies.adaptive_lift --rooms FOLDER --json benchmarks/results/adaptive_lift.json
"""

import json
import sys
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from experiments.command import CommandParser
from experiments.config import load_config
from experiments.evaluate.held_out import HeldOutPicture, held_out_pictures
from experiments.evaluate.room import EvaluationRoom, room_sources
from experiments.reconstruct.config import ReconstructConfig
from rein3d_jax.evaluate.regions import OBSERVED
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.lift import LiftConfig
from rein3d_jax.pipeline.survey import lift_scene
from rein3d_jax.rasterize import Buffers, RasterizeConfig, allocate, render
from rein3d_jax.scene import Gaussians

RECIPE = "quick"
SHARES = (1.0, 0.15, 0.25, 0.5, 0.1, 0.05)  # the first is what the others are compared with


@dataclass(frozen=True)
class Case:
    """A room, and the pictures held out of it."""

    room: EvaluationRoom
    views: list[HeldOutPicture]


def variants(lift: LiftConfig) -> dict[str, LiftConfig]:
    """Rows of the table."""
    return {f"share {share}": replace(lift, share=share) for share in SHARES}


def decibels(squared: np.ndarray) -> float:
    """PSNR of squared errors of colours in [0, 1]."""
    return float(-10 * np.log10(max(squared.mean(), 1e-10)))


def measure(scene: Gaussians, case: Case, raster: RasterizeConfig, buffers: Buffers) -> tuple[dict, Buffers]:
    """A room's row, and the buffers to reuse. PSNR: the novel views' mean, that of all their observed
    pixels together, and the origin's mean."""
    novel, observed, origin, alphas = [], [], [], []
    for view in case.views:
        frame, buffers = render(scene, view.camera, config=raster, buffers=buffers)
        alpha = np.asarray(frame.alpha)[..., None]
        picture = np.clip(np.clip(frame.rgb, 0, alpha) + (1 - alpha) * np.asarray(case.room.backdrop), 0, 1)
        squared = np.mean((picture - np.asarray(view.rgb)) ** 2, axis=-1)
        if view.kind == "origin":
            origin.append(decibels(squared))
            continue
        novel.append(decibels(squared))
        observed.append(squared[np.asarray(view.region) == OBSERVED])
        alphas.append(alpha.mean())
    row = {"count": int(jnp.sum(scene.alive)), "psnr": float(np.mean(novel)), "psnr_origin": float(np.mean(origin))}
    seen = {"psnr_observed": decibels(np.concatenate(observed)), "coverage": float(np.mean(alphas))}
    return row | seen, buffers


def rows_of(config: LiftConfig, cases: list[Case], raster: RasterizeConfig) -> list[dict]:
    """A variant's row of each room. Buffers are kept from room to room: the rasterizer compiles once or twice."""
    rows, buffers = [], None
    for case in cases:
        scene = lift_scene(case.room.panorama, config)
        needed = allocate(scene, [view.camera for view in case.views], config=raster, slack=1.0)
        buffers = needed if buffers is None else buffers.enlarged(needed)
        row, buffers = measure(scene, case, raster, buffers)
        rows.append(row)
    return rows


def summary(rows: list[dict], base: list[dict]) -> dict:
    """Means over rooms and their standard errors, of the figures and of the PSNR gained over `base`, room by room."""
    gained = [row["psnr"] - other["psnr"] for row, other in zip(rows, base, strict=True)]
    values = {key: [row[key] for row in rows] for key in rows[0]} | {"gain": gained}
    return {
        key: [round(float(np.mean(v)), 4), round(float(np.std(v, ddof=1)) / len(v) ** 0.5, 4)]
        for key, v in values.items()
    }


def main(arguments: list[str] | None = None) -> int:
    """Prints a line a variant."""
    parser = CommandParser("studies.adaptive_lift", __doc__, "benchmarks")
    parser.add_argument("--rooms", metavar="FOLDER", required=True)
    parser.add_argument("--json", metavar="FILE", help="write the table there")
    return parser.run(_run, arguments)


def _run(options) -> None:
    config = load_config(ReconstructConfig, RECIPE, [])
    cases = []
    for source in room_sources(options.rooms):
        room = EvaluationRoom(source, config)
        cases.append(Case(room, [view for view in held_out_pictures(room) if view.kind != "panorama"]))
    table, base = {}, None
    for name, variant in variants(config.lift).items():
        rows = rows_of(variant, cases, config.rasterize)
        base = base or rows
        table[name] = summary(rows, base) | {"rooms": rows}
        print(name, {key: value for key, value in table[name].items() if key != "rooms"}, flush=True)
        if options.json:
            report = {"recipe": RECIPE, "lift": asdict(config.lift), "columns": "mean, standard error", "rows": table}
            write_text(Path(options.json), json.dumps(report, indent=1) + "\n")


if __name__ == "__main__":
    sys.exit(main())
