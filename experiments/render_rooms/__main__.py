"""Render furnished rooms with real models in Blender Cycles: panoramas with exact distance, for training.

Each seed becomes a folder OUTPUT/room_000123, whole or not at all: KKK.png (sRGB), KKK.npz (`distance` in metres
along the ray, 0 outside; `linear` colour at the same exposure), 000_fine.* at twice the size in some rooms,
walk_KKK.* 0.1 m apart in some, and room.json (plan, poses, camera heights, credits and licences). With --empty the
finished rooms get KKK_empty.*, the same without furniture, and KKK_exit.npz, where each ray leaves the model that it
meets first. A run that was killed goes on where it stopped."""

import argparse
import itertools
import json
import os
import shutil
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from experiments.command import CommandParser
from experiments.render_rooms.assets import Catalog, load_catalog
from experiments.render_rooms.blender_process import BlenderProcess
from experiments.render_rooms.emptied import emptied_plan, missing_emptied
from experiments.render_rooms.layout import ShotList, plan_room
from rein3d_jax.errors import InputError

_FAILURES_IN_A_ROW = 8  # more are no bad luck


@dataclass(frozen=True, eq=False)
class _Job:
    """What Blender draws next, and the folder that the room has or shall have."""

    plan: dict
    target: Path
    emptied: tuple[str, ...] = ()  # what a finished room lacks; none for a new room


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0, or 2 with one line on stderr where the input is at fault."""
    parser = CommandParser("render_rooms", __doc__)
    parser.add_argument("--output", type=Path, required=True, help="folder for the rooms")
    parser.add_argument(
        "--assets", type=Path, required=True, help="folder with the two Debian packages of Sweet Home 3D"
    )
    parser.add_argument("--blender", type=Path, required=True, help="Python of the environment that holds bpy")
    parser.add_argument("--rooms", type=int, default=0, help="how many seeds; 0 goes on until stopped")
    parser.add_argument(
        "--empty",
        action="store_true",
        help="no new rooms, but KKK_empty.*, without furniture, and KKK_exit.npz for those in OUTPUT",
    )
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--worker", default="0/1", help="I/N: every N-th seed, beginning with the I-th")
    parser.add_argument("--views", type=int, default=2, help="panoramas a room")
    parser.add_argument("--height", type=int, default=128, help="rows of a panorama")
    parser.add_argument(
        "--fine-every", type=int, default=8, help="every so many rooms one panorama of twice the height"
    )
    parser.add_argument("--walk-every", type=int, default=16, help="every so many rooms a walk")
    parser.add_argument("--walk-frames", type=int, default=13, help="panoramas of a walk, at most")
    parser.add_argument("--samples", type=int, default=16, help="light paths a pixel, before the denoiser")
    parser.add_argument("--bounces", type=int, default=4, help="diffuse bounces")
    return parser.run(_render, arguments)


def worker_seeds(worker: str, first: int, rooms: int) -> Iterator[int]:
    """The seeds of worker I of N, without end if `rooms` is 0."""
    part, slash, parts = worker.partition("/")
    if not (slash and part.isdigit() and parts.isdigit() and int(part) < int(parts)):
        raise InputError(f'--worker "{worker}" is not I/N with 0 <= I < N; say 0/1 for one worker')
    seeds = itertools.count(first) if rooms == 0 else range(first, first + rooms)
    return (seed for seed in seeds if seed % int(parts) == int(part))


def _shots(options: argparse.Namespace, seed: int) -> ShotList:
    fine = 2 * options.height if options.fine_every and seed % options.fine_every == 1 else 0
    walk = options.walk_frames if options.walk_every and seed % options.walk_every == 3 else 0
    return ShotList(options.views, options.height, fine, walk)


def _render(options: argparse.Namespace) -> None:
    seeds = worker_seeds(options.worker, options.first, options.rooms)
    catalog = load_catalog(options.assets)
    options.output.mkdir(parents=True, exist_ok=True)
    log = options.output / f"blender_{'empty_' * options.empty}{options.worker.replace('/', '_of_')}.log"
    blender = BlenderProcess(options.blender, log)
    jobs = _emptied_jobs(options, catalog, seeds) if options.empty else _room_jobs(options, catalog, seeds)
    failures = 0
    for job in jobs:
        failures = 0 if _draw(options, blender, job) else failures + 1
        if failures == _FAILURES_IN_A_ROW:
            raise InputError(f"{failures} rooms in a row failed; see {log}")
    blender.stop()


def _room_jobs(options: argparse.Namespace, catalog: Catalog, seeds: Iterator[int]) -> Iterator[_Job]:
    """The rooms that are not there yet."""
    for seed in seeds:
        target = options.output / f"room_{seed:06d}"
        if not target.exists():
            yield _Job(plan_room(seed, catalog, _shots(options, seed)), target)


def _emptied_jobs(options: argparse.Namespace, catalog: Catalog, seeds: Iterator[int]) -> Iterator[_Job]:
    """The rooms that are there but lack something that --empty gives; those that were planned otherwise are counted."""
    last = max((int(room.name.removeprefix("room_")) for room in options.output.glob("room_*")), default=-1)
    skipped = 0
    for seed in itertools.takewhile(lambda seed: seed <= last, seeds):
        target = options.output / f"room_{seed:06d}"
        lacks = missing_emptied(target) if target.exists() else ()
        if not lacks:
            continue
        record = json.loads((target / "room.json").read_text())
        plan = emptied_plan(plan_room(seed, catalog, _shots(options, seed)), record)
        if plan is not None:
            yield _Job(plan, target, emptied=lacks)
            continue
        skipped += 1
        print(f"{target.name} skipped: it was planned by other code or for other panoramas", flush=True)
    print(f"{skipped} rooms skipped", flush=True)


def _draw(options: argparse.Namespace, blender: BlenderProcess, job: _Job) -> bool:
    """Draw into a partial folder, then give the room, or its new files, their names."""
    began = time.monotonic()
    left = f".partial_{'empty_' * bool(job.emptied)}{job.plan['seed']:06d}_"
    partial = options.output / f"{left}{os.getpid()}"
    for left_over in options.output.glob(f"{left}*"):
        shutil.rmtree(left_over, ignore_errors=True)
    settings = {
        "samples": options.samples,
        "bounces": options.bounces,
        "emptied": job.emptied,
        "furnished": str(job.target),
    }
    answer = blender.draw(job.plan, partial, settings)
    done = answer.startswith("done")
    if done and job.emptied:
        for path in sorted(partial.iterdir()):
            path.rename(job.target / path.name)
    elif done:
        partial.rename(job.target)
    shutil.rmtree(partial, ignore_errors=True)
    print(
        f"{job.target.name} {job.plan['style']} {answer} (CPU s, panoramas; {time.monotonic() - began:.0f} s in all)",
        flush=True,
    )
    return done


if __name__ == "__main__":
    sys.exit(main())
