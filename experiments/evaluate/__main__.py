"""Figures of how good each method is, on rooms with ground truth, by the paper's protocols.

    python -m experiments.evaluate --config quick --rooms FOLDER --json results.json
        [--protocol restoration|novel-views|no-reference] [--methods coarse,telea] [--limit N] [--set stage.key=value]
    python -m experiments.evaluate --chart results.json [more.json] [--picture chart.png] [--points points.json]

A room with ground truth is a folder with a scene.json (io/rooms/traced_room.py). no-reference also takes panoramas with
their distance: Structured3D's scenes, or NAME.png and NAME_distance.exr (io/rooms/panorama_sets.py).

The JSON has a key by protocol, in it one by method, in it one by metric, with `mean`, `sem` and `rooms`. What is done
is stored in the --work folder, by recipe, room and method: the same command goes on after a kill. Changed weights of a
restorer are not noticed: give another folder.
"""

import hashlib
import importlib.metadata
import json
import os
import platform
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import jax

from experiments.command import CommandParser
from experiments.compiled_programs import forget_when_many
from experiments.config import load_config
from experiments.evaluate.chart import chart, check_charts
from experiments.evaluate.methods import REFINED, chosen_methods, recipe_of
from experiments.evaluate.protocols import NO_TRUTH, PROTOCOLS, Tools
from experiments.evaluate.results import line, stored_outcome, table
from experiments.evaluate.room import EvaluationRoom, RoomSource, room_sources
from experiments.quick_process import begin_quickly, end_quickly
from experiments.reconstruct.config import ReconstructConfig
from experiments.reconstruct.job import PACKAGES
from rein3d_jax.errors import InputError
from rein3d_jax.evaluate.clip_features import ALEXNET, I3D
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.io.weights.metric_weights import brisque_weights, i3d_weights, lpips_weights, niqe_weights


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0, or 2 with one line on stderr where the input is at fault."""
    begin_quickly()
    parser = CommandParser("evaluate", __doc__)
    parser.add_recipe(ReconstructConfig, default="quick")
    parser.add_argument("--rooms", metavar="FOLDER", help="of rooms or panoramas, as above, or one room")
    parser.add_argument("--json", metavar="FILE", help="where to write the figures")
    parser.add_argument("--protocol", metavar="A,B", help=f"of {', '.join(map(_spoken, PROTOCOLS))}; default: all")
    parser.add_argument("--methods", metavar="A,B", help="default: all; `refined` runs the main job, minutes a room")
    parser.add_argument("--limit", metavar="N", type=int, help="only the first N rooms")
    parser.add_argument("--i3d", metavar="FILE", help="I3D's weights: the Frechet distance is then the FVD")
    parser.add_argument("--work", metavar="FOLDER", default="runs/evaluate", help="where finished rooms are stored")
    parser.add_argument("--chart", metavar="JSON", nargs="*", help="draw result files (default: the one of --json)")
    parser.add_argument("--picture", metavar="PNG", help="the chart's file (default: beside the first result)")
    parser.add_argument("--points", metavar="JSON", help="write there what the chart shows")
    return parser.run(_run, arguments)


def _run(options) -> None:
    if options.rooms is not None:
        if options.chart is not None:
            check_charts()  # minutes before there is anything to draw
        _evaluate(options)
    elif options.chart is None:
        raise InputError("give --rooms and --json to measure, or --chart and result files to draw")
    if options.chart is not None:
        files = [Path(name) for name in options.chart or filter(None, [options.json])]
        if not files:
            raise InputError("--chart needs result files: name them after it, or give --json")
        picture = Path(options.picture) if options.picture else files[0].with_suffix(".png")
        chart(files, picture, None if options.points is None else Path(options.points))
        print(f"open {picture}")


def _evaluate(options) -> None:
    """Measures and writes the JSON file. Raises InputError before the long part for whatever it can tell by then."""
    if options.json is None:
        raise InputError("--rooms also needs --json FILE")
    if options.limit is not None and options.limit < 1:
        raise InputError(f"--limit {options.limit} leaves no room: give 1 or more")
    config = load_config(ReconstructConfig, options.config, options.set)
    jobs = list(_jobs(options))
    rooms = room_sources(options.rooms, options.limit)
    if any(room.truth is None for room in rooms) and [protocol for protocol, _ in jobs] != [NO_TRUTH]:
        raise InputError(f"{options.rooms} holds panoramas without ground truth: give --protocol {_spoken(NO_TRUTH)}")
    results = _measure(rooms, jobs, options, config)
    write_text(options.json, json.dumps({**_circumstances(options, config, rooms), **results}, indent=1) + "\n")
    print(f"wrote {options.json}")


def _jobs(options) -> Iterator[tuple[str, list[str]]]:
    """(protocol, its methods) that were asked for."""
    wanted = None if options.methods is None else _listed(options.methods)
    protocols = list(PROTOCOLS) if options.protocol is None else _listed(options.protocol.replace("-", "_"))
    for protocol in protocols:
        if protocol not in PROTOCOLS:
            known = ", ".join(map(_spoken, PROTOCOLS))
            raise InputError(f'--protocol "{_spoken(protocol)}" is unknown; choose from {known}')
        offered = PROTOCOLS[protocol][1]
        methods = chosen_methods(wanted, offered)
        if not methods and options.protocol is not None:
            raise InputError(f"--protocol {_spoken(protocol)} has only the methods {', '.join(offered)}")
        yield protocol, methods


def _listed(names: str) -> list[str]:
    return [name.strip() for name in names.split(",")]


def _measure(sources: list[RoomSource], jobs: list[tuple[str, list[str]]], options, config: ReconstructConfig) -> dict:
    """{protocol: {method: {metric: ...}}}; room by room, so that what a room's methods share is made once."""
    recipe = recipe_of(config)
    work = Path(options.work) / hashlib.sha256(json.dumps(recipe, sort_keys=True).encode()).hexdigest()[:12]
    tools = _tools(options, work / REFINED)
    outcomes = {(protocol, method): {} for protocol, methods in jobs for method in methods}
    for source in sources:
        room, files = EvaluationRoom(source, config), source.digest()
        for (protocol, method), by_room in outcomes.items():
            depends = {"recipe": recipe, "room": files, "features": tools.features.label}
            file = work / protocol / room.name / f"{method}.json"
            measure = partial(PROTOCOLS[protocol][0], method, room, tools)
            by_room[room.name], found = stored_outcome(file, depends, measure)
            print(line(protocol, method, room.name, by_room[room.name].figures, found), flush=True)
        forget_when_many()  # each room compiles for sizes of its own
    features = "alexnet" if options.i3d is None else "i3d"
    return {
        protocol: {method: table(outcomes[protocol, method], features) for method in methods}
        for protocol, methods in jobs
        if methods
    }


def _tools(options, runs: Path) -> Tools:
    weights = lpips_weights()
    features = (ALEXNET, weights) if options.i3d is None else (I3D, i3d_weights(Path(options.i3d)))
    return Tools(weights, niqe_weights(), brisque_weights(), *features, runs)


def _circumstances(options, config: ReconstructConfig, rooms: list[RoomSource]) -> dict:
    """Recipe, rooms, versions and machine that the figures hold under."""
    device = jax.devices()[0]
    return {
        "recipe": " ".join([Path(options.config).stem, *options.set]),
        "config": recipe_of(config),
        "rooms": [room.name for room in rooms],
        "seeds": {"seed": config.seed},
        "clip_features": (ALEXNET if options.i3d is None else I3D).label,
        "versions": {
            "python": platform.python_version(),
            **{name: importlib.metadata.version(name) for name in PACKAGES},
        },
        "machine": {
            "system": platform.platform(),
            "cpu": _cpu(),
            "cores": os.cpu_count(),
            "device": device.device_kind,
        },
        "notes": _NOTES,
    }


def _cpu() -> str:
    """The processor's name where Linux tells it."""
    lines = Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else []
    return next((entry.partition(":")[2].strip() for entry in lines if entry.startswith("model name")), "unknown")


def _spoken(protocol: str) -> str:
    return protocol.replace("_", "-")


_NOTES = {
    "seconds": "from the panorama in memory to all of the room's pictures, compilation left out; refined: with the "
    "main job's stages and its compilation",
    "splits": "PSNR and SSIM by pixels are over all such pixels of a room; LPIPS has no value by pixel, only _at_ a "
    "camera's distance from the input. hole: alpha of the lifted scene below restore.observed. In novel_views the true "
    "distance tells observed, disoccluded and never_seen; a restored clip has none: see protocols.restoration",
    "holes": "where a method shows nothing stands the input's mean colour, in all methods alike",
    "frechet": "one distance of all rooms' clips, by the features that clip_features names; only I3D's make it an FVD",
    "psnr": "at most 100 dB, since JSON has no infinity",
}


if __name__ == "__main__":
    end_quickly(main())
