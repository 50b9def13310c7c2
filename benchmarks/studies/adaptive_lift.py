"""Gaussians against PSNR at novel views, lifted only: the adaptive lift at several shares, beside one Gaussian for each
pixel. Means over rooms, with standard errors.

    python -m benchmarks.studies.adaptive_lift --rooms FOLDER --json benchmarks/results/adaptive_lift.json
"""

import argparse
import json
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from experiments.evaluate.target import Target, targets

from experiments.config import load_config
from experiments.evaluate.room import Room, room_folders
from experiments.reconstruct.config import ReconstructConfig
from rein3d_jax.evaluate.regions import OBSERVED
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.lift import LiftConfig
from rein3d_jax.pipeline.survey import lift_scene
from rein3d_jax.rasterize import RasterizeConfig, allocate, enlarge, render
from rein3d_jax.scene import Gaussians

RECIPE = "experiments/recipes/quick.toml"
SHARES = (1.0, 0.15, 0.25, 0.5, 0.1, 0.05)  # the first is what the others are compared with


@dataclass(frozen=True)
class Case:
    """A room as this workload wants it: what is lifted, and the pictures to be met."""

    room: Room
    views: list[Target]


def variants(lift: LiftConfig) -> dict[str, LiftConfig]:
    """Rows of the table."""
    return {f"share {share}": replace(lift, share=share) for share in SHARES}


def decibels(squared: np.ndarray) -> float:
    """PSNR of squared errors of colours in [0, 1]."""
    return float(-10 * np.log10(max(squared.mean(), 1e-10)))


def measure(scene: Gaussians, case: Case, raster: RasterizeConfig) -> tuple[dict, RasterizeConfig]:
    """A room's row: PSNR meaned over novel views, over all their observed pixels together, and over the origin's."""
    novel, observed, origin, alphas = [], [], [], []
    for view in case.views:
        frame, raster = render(scene, view.camera, config=raster)
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
    return row | seen, raster


def rows_of(config: LiftConfig, cases: list[Case], raster: RasterizeConfig) -> list[dict]:
    """A variant's row of each room. Buffers are kept from room to room: the rasterizer compiles once or twice."""
    rows = []
    for case in cases:
        scene = lift_scene(case.room.panorama, config)
        needed = allocate(scene, [view.camera for view in case.views], config=raster, slack=1.0)
        row, raster = measure(scene, case, enlarge(raster, *needed.buffers))
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


def main() -> None:
    """Prints a line a variant, and writes the table as JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rooms", metavar="FOLDER", required=True)
    parser.add_argument("--json", metavar="FILE")
    options = parser.parse_args()
    config = load_config(ReconstructConfig, RECIPE, [])
    cases = []
    for folder in room_folders(options.rooms):
        room = Room(folder, config)
        cases.append(Case(room, [view for view in targets(room) if view.kind != "panorama"]))
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
    main()
