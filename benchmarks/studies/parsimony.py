"""No more than a scene needs: Gaussians and seconds against what stands in a room, from empty to cluttered.

    python -m benchmarks.studies.parsimony [--seeds N] [--set lift.worth=0.1] [--json FILE] [--picture PNG]

Drawn rooms, each with its first 0, 2, 4, ... pieces of furniture; the same with walls, floor and ceiling painted in one
colour each; and rooms made to measure, with boxes on their floor. By the recipe `draft`'s stages at 128 rows, with no
limit but `lift.worth`: lifted, and what is behind made up. PSNR at the ends of the paths, traced. Lengths of depth
edges are in radians on the sphere, CPU seconds those of a second run.
"""

import json
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.stability.case import drawn_room, traced
from benchmarks.stability.methods import splats
from benchmarks.stability.stage import scattered, staged_room
from benchmarks.studies.charts.parsimony import draw_parsimony
from benchmarks.studies.room_table import mean_and_error
from experiments.command import CommandParser
from experiments.compiled_programs import forget_when_many
from experiments.config import load_config
from experiments.reconstruct.config import ReconstructConfig
from rein3d_jax.evaluate.metrics import psnr
from rein3d_jax.explore.trajectories import path_ends, radial_trajectories
from rein3d_jax.geometry.poses import equirectangular_camera
from rein3d_jax.geometry.sphere import pixel_solid_angles
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.lift.surface import beside_steps
from rein3d_jax.networks.trained import read_network
from rein3d_jax.pipeline.peel_scene import peel_scene
from rein3d_jax.pipeline.stages import origin_pose
from rein3d_jax.pipeline.survey import Survey, lift_scene, room_background
from rein3d_jax.restore import restorer
from rein3d_jax.rooms.generate import pack
from rein3d_jax.rooms.model import Room
from rein3d_jax.scene import Gaussians, Panorama

COUNTS = (0, 2, 4, 8, 16, 32)  # pieces; a drawn room has 14 at most
ROWS, VIEW_ROWS = 128, 64  # of the input, and of what it is judged by
DRAWN, PAINTED, BOXES = "drawn rooms", "the same, painted", "boxes in papered rooms"
SHARE = 0.99  # Gaussians a pixel at most: what a scene needs is not to be cut short
_FIRST_PIECE = 11  # object ids below are the shell, its openings and the structure
_SHELL_ROWS = slice(0, 6)  # of textures
_SOLIDS = ("boxes", "cylinders", "ellipsoids")
_PATTERN = ("contrast", "joint", "variation")
_RADIANS = np.pi / ROWS  # a pixel's height


@dataclass(frozen=True)
class Made:
    """A scene, the Gaussians of its lifted part, and CPU seconds by stage."""

    scene: Gaussians
    observed: int
    cpu: dict[str, float]


def emptied(room: Room, pieces: int) -> tuple[Room, int]:
    """The room with its first `pieces` pieces of furniture, and how many these are."""
    found = sorted({int(name) for kind in _SOLIDS for name in _names(getattr(room, kind)) if name >= _FIRST_PIECE})
    last = found[:pieces][-1] if found[:pieces] else _FIRST_PIECE - 1
    left = {kind: _up_to(getattr(room, kind), last) for kind in _SOLIDS}
    return room.replace(**left), len(found[:pieces])


def _names(solids) -> np.ndarray:
    return np.asarray(solids.object)[: int(solids.count)]


def _up_to(solids, last: int):
    slot = jnp.arange(len(solids.object))
    kept = (slot < solids.count) & (solids.object <= last)
    return pack(solids, kept, slot < solids.casters, len(slot))[0]


def _drawn(seed: int) -> Iterator[tuple[int, Room]]:
    """The room of a seed, fuller and fuller."""
    room, before = drawn_room(seed), -1
    for count in COUNTS:
        less, pieces = emptied(room, count)
        if pieces > before:
            yield pieces, less
        before = pieces


def _painted(seed: int) -> Iterator[tuple[int, Room]]:
    """The same, no texture on floor, walls and ceiling."""
    for pieces, room in _drawn(seed):
        plain = {name: getattr(room.textures, name).at[_SHELL_ROWS].set(0.0) for name in _PATTERN}
        yield pieces, room.replace(textures=room.textures.replace(**plain))


def _boxed(seed: int) -> Iterator[tuple[int, Room]]:
    return ((count, staged_room(scattered(count, seed), seed)) for count in COUNTS)


SERIES: dict[str, Callable[[int], Iterator[tuple[int, Room]]]] = {
    DRAWN: _drawn, PAINTED: _painted, BOXES: _boxed,
}  # fmt: skip


def made_of(panorama: Panorama, config: ReconstructConfig) -> Made:
    """What the pure stages of the recipe make of a panorama."""
    cpu: dict[str, float] = {}
    background = _clocked(cpu, "shell", lambda: room_background(panorama, config.restore))
    lifted = _clocked(cpu, "lift", lambda: lift_scene(panorama, config.lift))
    paths = _clocked(cpu, "paths", lambda: radial_trajectories(panorama, config=config.explore))
    known = Survey(panorama, lifted, paths)
    restore = restorer(config.restore, background, read_network(config.restore))
    scene = _clocked(cpu, "peel", lambda: peel_scene(known, background, restore, jax.random.key(0), stages=config))
    return Made(scene, int(lifted.alive.sum()), cpu)


def _clocked(cpu: dict[str, float], name: str, work: Callable):
    started = time.process_time()
    made = jax.block_until_ready(work())
    cpu[name] = round(time.process_time() - started, 3)
    return made


def row_of(room: Room, pieces: int, config: ReconstructConfig) -> dict:
    """The figures of one room."""
    panorama = _seen(room, origin_pose(), ROWS)
    made_of(panorama, config)  # compiles
    made = made_of(panorama, config)
    poses = path_ends(radial_trajectories(panorama, config=config.explore))
    decibels = [_psnr(made.scene, _seen(room, pose, VIEW_ROWS), pose) for pose in poses]
    edges = np.asarray(beside_steps(1 / panorama.distance, config.lift.leaf_step))
    area = np.broadcast_to(np.asarray(pixel_solid_angles(*edges.shape)), edges.shape)
    return {
        "pieces": pieces, "edges": round(float((edges * area).sum()) / (2 * _RADIANS), 2),
        "picture": len(_png(panorama.rgb)), "observed": made.observed,
        "behind": int(made.scene.alive.sum()) - made.observed, "psnr": round(float(np.mean(decibels)), 3),
        "cpu": made.cpu,
    }  # fmt: skip


def _seen(room: Room, pose: jax.Array, rows: int) -> Panorama:
    view = traced(room, pose, height=rows, samples=2)
    return Panorama(view.rgb, view.distance, view.distance > 0)


def _psnr(scene: Gaussians, truth: Panorama, pose: jax.Array) -> float:
    rgb, alpha, _ = splats(scene)(equirectangular_camera(pose, VIEW_ROWS))
    backdrop = jnp.mean(truth.rgb, axis=(0, 1))
    return float(psnr(alpha[..., None] * rgb + (1 - alpha[..., None]) * backdrop, truth.rgb))


def _png(rgb: jax.Array) -> bytes:
    return cv2.imencode(".png", (np.asarray(rgb)[..., ::-1] * 255).round().astype(np.uint8))[1].tobytes()


def summary(rows: list[dict]) -> dict:
    """Of a series: the emptiest room's share of the fullest's, seed by seed with its standard error, and lines through
    Gaussians: how many a piece or a radian of depth edge adds, those of none, and the scatter about the line."""
    seeds = sorted({row["seed"] for row in rows})
    ends = [[row for row in rows if row["seed"] == seed] for seed in seeds]
    shares = {
        name: mean_and_error([value(of_one[0]) / value(of_one[-1]) for of_one in ends], digits=3)
        for name, value in {"gaussians": total, "cpu": seconds, "behind": lambda row: max(row["behind"], 1)}.items()
    }
    lines = {key: _line([row[key] for row in rows], [total(row) for row in rows]) for key in ("pieces", "edges")}
    return {"empty over full": shares, "gaussians by": lines}


def total(row: dict) -> int:
    """Gaussians, all."""
    return row["observed"] + row["behind"]


def seconds(row: dict) -> float:
    """CPU seconds, all stages."""
    return sum(row["cpu"].values())


def _line(x: list[float], y: list[float]) -> dict[str, float]:
    slope, start = np.polyfit(x, y, 1)
    rest = np.asarray(y) - (slope * np.asarray(x) + start)
    return {"slope": round(float(slope), 1), "at none": round(float(start)), "scatter": round(float(rest.std(ddof=2))),
            "r2": round(float(1 - rest.var() / np.var(y)), 3)}  # fmt: skip


def main(arguments: list[str] | None = None) -> int:
    """Prints a line a room, then the lines through them."""
    parser = CommandParser("studies.parsimony", __doc__, "benchmarks")
    parser.add_argument("--seeds", metavar="N", type=int, default=4, help="rooms of a kind (default: %(default)s)")
    parser.add_argument("--set", metavar="KEY=VALUE", action="append", default=[], help="change a key of the recipe")
    parser.add_argument("--json", metavar="FILE", type=Path, help="write the figures there")
    parser.add_argument("--picture", metavar="PNG", type=Path, help="draw them there")
    return parser.run(_run, arguments)


def _run(options) -> None:
    size = [f"restore.height={ROWS}", f"lift.share={SHARE}"]
    config = load_config(ReconstructConfig, "draft", [*size, *options.set])
    table: dict[str, dict] = {}
    for name, rooms in SERIES.items():
        rows = []
        for seed in range(options.seeds):
            for pieces, room in rooms(seed):
                rows.append({"seed": seed} | row_of(room, pieces, config))
                print(name, rows[-1], flush=True)
                forget_when_many()
        table[name] = summary(rows) | {"rooms": rows}
        print(name, summary(rows), flush=True)
    if options.json:
        write_text(options.json, json.dumps(table, indent=1) + "\n")
    if options.picture:
        draw_parsimony(table, options.picture)


if __name__ == "__main__":
    sys.exit(main())
