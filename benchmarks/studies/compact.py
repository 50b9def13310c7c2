"""The compact form: quality at novel views against bytes, by format, and by what makes a scene smaller.

    python -m benchmarks.studies.compact --rooms FOLDER [--scenes FOLDER] [--json FILE] [--picture PNG]

Scenes of the recipe `draft`'s stages, with dearer and dearer Gaussians (`lift.worth`); the same counts of the full
scene by what each adds to views on the spot, by opacity and size, and by opacity. Each count is written in each format
and read back; of SOG, which splat-transform reads for us, there are bytes alone where that is not installed. Means over
rooms, with standard errors; differences room by room. --scenes keeps the scenes as NPZ.
"""

import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.studies.charts.compact import draw_compact, rows_of_front
from benchmarks.studies.export_readers import READERS
from benchmarks.studies.peel import RECIPE
from benchmarks.studies.room_table import StudiedRoom, mean_and_error
from experiments.command import CommandParser
from experiments.compiled_programs import forget_when_many
from experiments.config import load_config
from experiments.evaluate.held_out import held_out_pictures
from experiments.evaluate.room import EvaluationRoom, room_sources
from experiments.reconstruct.config import ReconstructConfig
from rein3d_jax.explore.trajectories import path_ends
from rein3d_jax.geometry.poses import equirectangular_camera
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.io.splats.gaussian_file import read_splats, write_splats
from rein3d_jax.io.splats.spz import read_spz, write_spz
from rein3d_jax.io.weights.metric_weights import lpips_weights
from rein3d_jax.lift import compact
from rein3d_jax.networks.trained import read_network
from rein3d_jax.pipeline.peel_scene import peel_scene
from rein3d_jax.pipeline.stages import origin_pose
from rein3d_jax.pipeline.survey import room_background, survey
from rein3d_jax.refine.prune import contribution, prune_to
from rein3d_jax.restore import restorer
from rein3d_jax.scene import Gaussians

WORTHS = (0.01, 0.016, 0.032, 0.1, 0.3)  # the first is draft's: about all, 75, 50, 25 and 12 % of its Gaussians
FORMATS = ("ply", "compressed.ply", "splat", "spz 3", "spz 4", "sog")
LIFTED = "lift.worth"
_ROWS = 256  # of the views on the spot
_VIEWS = 4  # novel views of a room, every so many-th
_TOOL = READERS / "node_modules" / ".bin" / "splat-transform"


@dataclass(frozen=True)
class Reduced:
    """A smaller scene."""

    way: str
    worth: float  # the step of WORTHS whose count it has
    scene: Gaussians


def made_at(worth: float, room: EvaluationRoom, config: ReconstructConfig) -> Gaussians:
    """The scene of draft's stages, in as few slots as it fills."""
    stages = replace(config, lift=replace(config.lift, worth=worth))
    known, background = survey(room.panorama, stages), room_background(room.panorama, stages.restore)
    restore = restorer(stages.restore, background, read_network(stages.restore))
    return compact(peel_scene(known, background, restore, jax.random.key(0), stages=stages))


def _kept(path: Path | None, make) -> Gaussians:
    """The scene in `path`, made and written where it is not there."""
    names = [field.name for field in fields(Gaussians)]
    if path and path.exists():
        with np.load(path) as arrays:
            return Gaussians(**{name: jnp.asarray(arrays[name]) for name in names})
    scene = make()
    if path:
        path.parent.mkdir(parents=True, exist_ok=True)
        np.savez_compressed(path, **{name: np.asarray(getattr(scene, name)) for name in names})
    return scene


def reductions(room: EvaluationRoom, config: ReconstructConfig, scenes: Path | None) -> Iterator[Reduced]:
    """The scenes to be written: lifted with fewer, and the full one pruned to these counts."""
    full = None
    for worth in WORTHS:
        path = scenes / f"{room.name}_worth{worth:g}.npz" if scenes else None
        scene = _kept(path, lambda worth=worth: made_at(worth, room, config))
        yield Reduced(LIFTED, worth, scene)
        if full is None:
            full, orders = scene, _orders(scene, room, config)
            continue
        for way, weight in orders.items():
            left = prune_to(full, weight, int(scene.alive.sum()))
            yield Reduced(way, worth, compact(left))


def _orders(scene: Gaussians, room: EvaluationRoom, config: ReconstructConfig) -> dict[str, jax.Array]:
    """What each Gaussian counts for, (n,). As lifted all are equally opaque: by opacity alone it is chance."""
    poses = [origin_pose(), *path_ends(survey(room.panorama, config).trajectories)]
    cameras = [equirectangular_camera(pose, _ROWS) for pose in poses]
    first, second, _ = jnp.sort(scene.log_scales, axis=-1)[:, ::-1].T
    return {
        "by contribution": contribution(scene, cameras, config=config.rasterize),
        "by opacity and size": jax.nn.sigmoid(scene.opacity_logits) * jnp.exp(first + second),
        "by opacity": jax.nn.sigmoid(scene.opacity_logits) + 1e-6 * jax.random.uniform(jax.random.key(0), first.shape),
    }


def written(scene: Gaussians, format: str, folder: Path) -> tuple[int, Gaussians | None]:
    """Bytes of the scene in a format, and what is read back; None of SOG without its reader."""
    name, _, version = format.partition(" ")
    path = folder / f"scene.{name}"
    if version:
        write_spz(path, scene, antialias=True, version=int(version))
        return path.stat().st_size, read_spz(path)
    write_splats(path, scene, antialias=name in ("ply", "sog"))
    if name != "sog":
        return path.stat().st_size, read_splats(path)
    if not _TOOL.exists():
        return path.stat().st_size, None
    back = folder / "back.ply"
    subprocess.run([_TOOL, "-w", path, back], check=True, capture_output=True)
    return path.stat().st_size, read_splats(back)


def rows_of(at: StudiedRoom, scenes: Path | None) -> Iterator[dict]:
    """A room's rows: way, worth, format, bytes, count, psnr and lpips."""
    for made in reductions(at.room, at.config, scenes):
        formats = FORMATS if made.way == LIFTED else ("ply",)
        with tempfile.TemporaryDirectory() as folder:
            for format in formats:
                size, back = written(made.scene, format, Path(folder))
                row = {"way": made.way, "worth": made.worth, "format": format, "bytes": size}
                yield row | ({} if back is None else at.figures(_padded(back), {}))
        forget_when_many()


def _padded(scene: Gaussians) -> Gaussians:
    """In a buffer of a power of 2: the rasterizer compiles seldom."""
    return compact(scene, capacity=1 << (scene.alive.size - 1).bit_length())


def summary(rooms: dict[str, list[dict]]) -> list[dict]:
    """Means and standard errors over rooms, and of PSNR the difference to the whole scene as PLY, room by room."""
    found = []
    for i, first in enumerate(next(iter(rooms.values()))):
        of_rooms = [rows[i] for rows in rooms.values()]
        row = {key: first[key] for key in ("way", "worth", "format")}
        row |= {key: mean_and_error([x[key] for x in of_rooms]) for key in first if key not in row}
        if "psnr" in first:
            lost = [rows[i]["psnr"] - rows[0]["psnr"] for rows in rooms.values()]
            row["difference"] = mean_and_error(lost)
        found.append(row)
    return found


def main(arguments: list[str] | None = None) -> int:
    """Prints a line a scene and format, then the front."""
    parser = CommandParser("studies.compact", __doc__, "benchmarks")
    parser.add_argument("--rooms", metavar="FOLDER", required=True)
    parser.add_argument("--scenes", metavar="FOLDER", type=Path, help="keep the scenes there, and read them again")
    parser.add_argument("--json", metavar="FILE", type=Path, help="write the figures there, as they come")
    parser.add_argument("--picture", metavar="PNG", type=Path, help="draw them there")
    return parser.run(_run, arguments)


def _run(options) -> None:
    config, weights = load_config(ReconstructConfig, RECIPE, []), lpips_weights()
    rooms: dict[str, list[dict]] = {}
    for source in room_sources(options.rooms):
        room = EvaluationRoom(source, config)
        novel = [view for view in held_out_pictures(room) if view.kind == "view"]
        studied = StudiedRoom(config, room, novel[:: max(len(novel) // _VIEWS, 1)][:_VIEWS], weights, None)
        rooms[source.name] = list(rows_of(studied, options.scenes))
        for row in rooms[source.name]:
            print(source.name, row, flush=True)
        report = {"recipe": RECIPE, "columns": "mean, standard error", "rows": summary(rooms), "rooms": rooms}
        if options.json:
            write_text(options.json, json.dumps(report, indent=1) + "\n")
    for row in rows_of_front(report["rows"]):
        print("front:", row["way"], row["worth"], row["format"], row["bytes"], row["psnr"], row["difference"])
    if options.picture:
        draw_compact(report["rows"], options.picture)


if __name__ == "__main__":
    sys.exit(main())
