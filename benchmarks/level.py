"""Levelling against rooms that were leaned by a known angle: degrees from the true up, before and after.

    python -m benchmarks.level ROOMS [--seeds 4] [--json FILE]

ROOMS holds folders with an upright input.png. Each is leaned by 0, 2, 4, 8 and 12 degrees about random level axes, by
cubic interpolation as a camera's own software would. A picture that is left alone keeps the lean it came with.
"""

import argparse
import json
import sys
import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from experiments.command import CommandParser
from rein3d_jax.depth.level import NOT_TOLD, Lean, estimate_lean, level_panorama
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.io.pictures.photo import read_rgb
from rein3d_jax.scene import Panorama

LEANS = (0, 2, 4, 8, 12)  # degrees


def main(arguments: list[str] | None = None) -> int:
    """Prints a table. Exit code 0, or 2 where the input is at fault."""
    parser = CommandParser("level", __doc__, package="benchmarks")
    parser.add_argument("rooms", type=Path)
    parser.add_argument("--seeds", type=int, default=4, help="axes a room and lean (%(default)s)")
    parser.add_argument("--json", metavar="FILE", type=Path, help="write the figures there")
    return parser.run(_run, arguments)


def _run(options: argparse.Namespace) -> None:
    pictures = {path.parent.name: read_rgb(path) for path in sorted(options.rooms.glob("*/input.png"))}
    rows = [
        {"room": name, "lean": lean, **_measured(rgb, lean, np.random.default_rng([number, lean, seed]))}
        for number, (name, rgb) in enumerate(pictures.items())
        for lean in LEANS
        for seed in range(options.seeds if lean else 1)
    ]
    table = {str(lean): _summary([row for row in rows if row["lean"] == lean]) for lean in LEANS}
    table["all"] = _summary([row for row in rows if row["lean"]])
    for lean, summary in table.items():
        print(f"{lean:>4}  " + "  ".join(f"{name} {value:.2f}" for name, value in summary.items()), flush=True)
    if options.json:
        figures = {"rooms": list(pictures), "seeds": options.seeds, "device": jax.devices()[0].device_kind}
        write_text(options.json, json.dumps(figures | {"table": table, "pictures": rows}, indent=1) + "\n")


def _measured(rgb: np.ndarray, lean: float, rng: np.random.Generator) -> dict:
    """Degrees between the picture's up and the true one: as estimated, and as the picture is left."""
    azimuth = rng.uniform(0, 2 * np.pi)
    flat = np.sin(np.radians(lean)) * np.array([np.cos(azimuth), np.sin(azimuth)])
    up = np.array([*flat, np.cos(np.radians(lean))])
    given = Lean(jnp.asarray(up, jnp.float32), jnp.array(1.0))
    if lean:
        nothing = jnp.zeros(rgb.shape[:2])
        rgb = level_panorama(Panorama(jnp.asarray(rgb), nothing, nothing > 0), given.level_from_picture.T).rgb
    begun = time.perf_counter()
    found = jax.block_until_ready(estimate_lean(jnp.asarray(rgb)))
    seconds = time.perf_counter() - begun
    left = np.asarray(found.level_from_picture) @ up
    return {
        "estimated": _degrees(np.asarray(found.up), up),
        "after": _degrees(left, np.array([0.0, 0.0, 1.0])),
        "confidence": round(float(found.confidence), 4),
        "verdict": found.verdict,
        "seconds": round(seconds, 3),
    }


def _degrees(a: np.ndarray, b: np.ndarray) -> float:
    return round(float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))), 4)


def _summary(rows: list[dict]) -> dict[str, float]:
    after, estimated = ([row[name] for row in rows] for name in ("after", "estimated"))
    return {
        "median": float(np.median(after)),
        "90%": float(np.quantile(after, 0.9)),
        "worst": max(after),
        "estimate_median": float(np.median(estimated)),
        "estimate_worst": max(estimated),
        "not_told": float(np.mean([row["verdict"] == NOT_TOLD for row in rows])),
        "seconds": float(np.median([row["seconds"] for row in rows])),
    }


if __name__ == "__main__":
    sys.exit(main())
