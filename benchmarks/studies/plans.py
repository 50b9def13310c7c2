"""Speed against accuracy of the whole job, every plan of `budget.seconds` among others and the ways of peers.

PSNR, LPIPS and the PSNR of what was hidden, against the processor's seconds and the scene's bytes.

    python -m benchmarks.studies.plans --rooms FOLDER --json benchmarks/results/plans.json [--only NAME,NAME]
    python -m experiments.evaluate --chart benchmarks/results/plans.json

The distance is given. Quality is that of all rooms, its scenes made by the stages in this process. The cost is that of
whole jobs in processes of their own, programs compiled before, as a user has it the second time, in the first COSTED
rooms: it hardly depends on the room. What is done is kept in the --work folder.
"""

import dataclasses
import hashlib
import json
import os
import subprocess
import sys
from functools import partial
from pathlib import Path

import jax

from benchmarks.studies.room_table import StudiedRoom
from benchmarks.studies.scene import NO_LAYERS
from experiments.command import CommandParser
from experiments.compiled_programs import forget_when_many
from experiments.config import load_config, toml_value
from experiments.evaluate.held_out import held_out_pictures
from experiments.evaluate.pareto import pareto_front
from experiments.evaluate.protocols import REGIONS, Outcome
from experiments.evaluate.results import stored_outcome, table
from experiments.evaluate.room import EvaluationRoom, RoomSource, room_sources
from experiments.reconstruct.budget import bytes_of_one
from experiments.reconstruct.config import ReconstructConfig
from experiments.reconstruct.inputs import told_panorama
from experiments.reconstruct.plans import PLANS
from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.io.files.json_file import read_json
from rein3d_jax.io.weights.metric_weights import lpips_weights
from rein3d_jax.networks.trained import read_network
from rein3d_jax.networks.upsampler import read_upsampler
from rein3d_jax.pipeline.reconstruct import reconstruct
from rein3d_jax.pipeline.stages import Stages

COSTED = 1
BUDGETS = (10, 20, 40, 80, 160)  # of the processor's seconds
RECIPES = ("draft", "quick")
_COMPILED = 3.0  # seconds in which a job's programs are at most read, not compiled
_DRAFT = ("input.height=256", "input.upsample=none", "explore.trajectories=3")
_ONE_A_PIXEL = ("lift.share=1", "lift.worth=0")

OTHERS = {"512 learned": ("input.height=512", "input.upsample=learned", "explore.trajectories=1", "refine.steps=0")}
PEERS = {
    "lifted only": (*_DRAFT, *NO_LAYERS, "restore.method=none", "refine.steps=0"),
    "a ball a pixel": (*_DRAFT, *NO_LAYERS, *_ONE_A_PIXEL, "restore.method=none", "refine.steps=0", "lift.steepest=0",
                       "lift.thickness=1", "lift.sharpen=0", "lift.footprint=0.85", "lift.plain_footprint=0.85",
                       "rasterize.filter=added", "rasterize.filter_variance=0.3", "rasterize.antialias=false"),
    "OpenCV's Telea": (*_DRAFT, "restore.method=telea"),
}  # fmt: skip


def jobs() -> dict[str, tuple[str, tuple[str, ...]]]:
    """(recipe, settings) by name."""
    of_quick = {plan.name: plan.settings for plan in PLANS} | OTHERS | PEERS
    return {name: (name, ()) for name in RECIPES} | {name: ("quick", settings) for name, settings in of_quick.items()}


def run_job(recipe: str, settings: tuple[str, ...], source: RoomSource, output: Path) -> dict:
    """metrics.json of a job in a process of its own, which compiles little. Raises RuntimeError where it fails."""
    changes = [word for setting in ("input.level=false", *settings) for word in ("--set", setting)]
    files = ["--input", str(source.rgb), "--distance", str(source.distance), "--output", str(output)]
    command = [sys.executable, "-m", "experiments.reconstruct", "--config", recipe, *files, *changes]
    for _ in range(2):
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
        if done.returncode:
            raise RuntimeError(done.stdout)
        metrics = read_json(output / "metrics.json")
        if max(metrics["program_seconds"]["compile"].values()) < _COMPILED:
            break
    return metrics


def cost(recipe: str, settings: tuple[str, ...], source: RoomSource, output: Path) -> Outcome:
    """Seconds of a whole job: the processor's, and those that a user waits."""
    metrics = run_job(recipe, settings, source, output)
    return Outcome({"cpu_seconds": metrics["cpu_seconds"], "wall_seconds": metrics["seconds"]["total"]})


def quality(recipe: str, settings: tuple[str, ...], studied: StudiedRoom) -> Outcome:
    """How good a job's scene is at the room's novel views, and its bytes."""
    source = studied.room.source
    files = [f"input.panorama={toml_value(str(source.rgb))}", f"input.distance={toml_value(str(source.distance))}"]
    config = load_config(ReconstructConfig, recipe, [*files, "input.level=false", *settings])
    panorama, _, _ = told_panorama(config.input, read_upsampler(config.input.upsample))
    stages = Stages(**{field.name: getattr(config, field.name) for field in dataclasses.fields(Stages)})
    made = reconstruct(panorama, jax.random.key(config.seed), stages=stages, network=read_network(config.restore))
    figures = studied.figures(made.scene, {f"psnr_{name}": code for name, code in REGIONS.items()})
    return Outcome(figures | {"bytes": figures["count"] * bytes_of_one(config.refine.sh_degree)})


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0, or 2 with one line on stderr where an argument is at fault."""
    parser = CommandParser("studies.plans", __doc__, "benchmarks")
    parser.add_argument("--rooms", metavar="FOLDER", required=True)
    parser.add_argument("--json", metavar="FILE", required=True)
    parser.add_argument("--only", metavar="A,B", help=f"of {'; '.join(jobs())}")
    parser.add_argument("--limit", metavar="N", type=int, help="only the first N rooms")
    parser.add_argument("--work", metavar="FOLDER", default="runs/plans", help="where jobs are kept")
    return parser.run(_run, arguments)


def _run(options) -> None:
    chosen = jobs() if options.only is None else {name: jobs().get(name) for name in options.only.split(",")}
    if unknown := [name for name, job in chosen.items() if job is None]:
        raise InputError(f"--only: {unknown[0]} is unknown; choose from {', '.join(jobs())}")
    outcomes: dict[str, dict] = {name: {} for name in chosen}
    config, weights, buffers = load_config(ReconstructConfig, "quick", []), lpips_weights(), None
    sources = room_sources(options.rooms, options.limit)
    for source in sources:
        room = EvaluationRoom(source, config)
        views = [view for view in held_out_pictures(room) if view.kind == "view"]
        studied, files = StudiedRoom(config, room, views, weights, buffers), source.digest()
        for name, (recipe, settings) in chosen.items():
            depends = {"recipe": recipe, "settings": settings, "room": files}
            place = Path(options.work) / room.name / hashlib.sha256(name.encode()).hexdigest()[:8]
            found, _ = stored_outcome(place / "quality.json", depends, partial(quality, recipe, settings, studied))
            if source in sources[:COSTED]:
                make = partial(cost, recipe, settings, source, place / "run")
                found = Outcome(found.figures | stored_outcome(place / "cost.json", depends, make)[0].figures)
            outcomes[name][room.name] = found
            shown = {key: round(value, 3) for key, value in found.figures.items()}
            print(f"{room.name:8} {name:28} {shown}", flush=True)
        buffers = studied.buffers
        forget_when_many()
    rows = {name: table(by_room, "") for name, by_room in outcomes.items()}
    report = {"recipe": "plans", "cores": os.cpu_count(), "rooms": [source.name for source in sources]}
    report |= {"settings": {name: [recipe, *settings] for name, (recipe, settings) in chosen.items()}}
    report |= {"lost_to_the_front": lost_to_the_front(rows), "novel_views": rows}
    write_text(Path(options.json), json.dumps(report, indent=1) + "\n")
    print(json.dumps(report["lost_to_the_front"], indent=1))


def lost_to_the_front(rows: dict[str, dict]) -> dict[str, dict]:
    """For each of BUDGETS the best of all jobs that keep to it, the plan, and by how many dB that is behind."""
    points = {name: (row["cpu_seconds"]["mean"], row["psnr"]["mean"]) for name, row in rows.items()}
    plans = {plan.name: points[plan.name] for plan in PLANS if plan.name in points}
    found = {}
    for budget in BUDGETS:
        best, plan = (_best(of, budget) for of in (points, plans))
        if best and plan:
            found[f"{budget} s"] = {"best": best, "plan": plan, "behind": round(points[best][1] - points[plan][1], 3)}
    names = list(points)
    return found | {"front": [names[i] for i in pareto_front(list(points.values()))]}


def _best(points: dict[str, tuple[float, float]], budget: float) -> str | None:
    within = {name: psnr for name, (seconds, psnr) in points.items() if seconds <= budget}
    return max(within, key=within.__getitem__, default=None)


if __name__ == "__main__":
    sys.exit(main())
