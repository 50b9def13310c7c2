"""What a job will take: seconds by stage, foreseen from its sizes, corrected by what jobs took on this machine before.

A stage takes its share of the work, and makes its programs: compiled the first time, read from the cache afterwards.
The model's numbers are those of two cores of an AMD EPYC with nothing else to do; a short calibration says how fast
this machine is, and how busy, until a job has told by stage.
"""

import dataclasses
import hashlib
import json
import os
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import cache
from pathlib import Path

import jax
import numpy as np

from experiments.reconstruct.config import ReconstructConfig
from experiments.reconstruct.diffusion_cost import restore_seconds
from experiments.reconstruct.inputs import InputConfig
from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.pipeline.refine_scene import STILL_OF_A_PIXEL
from rein3d_jax.restore.restorer import DIFFUSION
from rein3d_jax.upsample import LEARNED, NONE

_MODEL = 2  # of the numbers below: slowness against other ones says nothing
COUNTED = ("read", "lift", "explore", "peel", "restore", "refine", "write")
# Seconds for programs, compiled and kept, of every job; of what only some have: an estimated distance, which leaves an
# outside to be made up, a network for a finer picture, views to compare with, a restored path and what is fitted to it.
_COMPILED = dict(zip(COUNTED, (2.3, 9.5, 0.4, 14.0, 2.4, 0.9, 3.8), strict=True))
_KEPT = dict(zip(COUNTED, (0.6, 2.2, 0.1, 4.5, 1.0, 0.5, 2.0), strict=True))
_OF_ESTIMATE = {"read": (16.0, 2.0), "peel": (5.0, 0.5)}
_OF_FINER, _OF_VIEWS = (9.0, 3.5), (3.5, 0.5)
_OF_A_PATH = {"restore": (7.5, 0.5), "refine": (11.0, 0.5)}
# Of jobs that restore only what opens enough, those in which some path does. Where the distance is an estimate nothing
# tells before the run: half a path is foreseen, and neither a path nor none is far off.
_OPENS = 0.5
_CALIBRATED = 0.54  # processor's seconds that `_calibration`'s work takes on the model's machine
_WAY = 6.0  # metres of a path, on average


class SecondsForecast:
    """The seconds of one job; the file beside the kept programs remembers what jobs took."""

    def __init__(self, config: ReconstructConfig, rows: int, *, upsampled: bool):
        self.work, self.keys = _work(config, rows, upsampled=upsampled), _keys(config, rows, upsampled=upsampled)
        self.workers = _workers(config, upsampled=upsampled)
        # Between the stages: what stands at the start, and the first look, whose page packs the lifted scene.
        self.beside = 1.0 + 10 * _gaussians(config, rows)
        self.compiled, self.kept = (_programs(config, kept=kept, upsampled=upsampled) for kept in (False, True))
        folder = jax.config.jax_compilation_cache_dir
        self.file = None if folder is None else Path(folder) / "seconds.json"
        self.known = {} if self.file is None else recalled(self.file)

    def seconds(self) -> dict[str, float]:
        """By stage, and their total."""
        slowness, known = self._slowness(), self.known
        programs = {
            stage: known[key] if key in known else _calibration() * self.compiled[stage]
            for stage, key in self.keys.items()
        }
        found = {stage: round(slowness[stage] * self.work[stage] + programs[stage], 1) for stage in COUNTED}
        return found | {"total": round(sum(found.values()) + slowness["write"] * self.beside, 1)}

    def remember(self, seconds: dict[str, float], programs: dict[str, dict[str, float]]) -> None:
        """Keeps what a whole job took by stage, and how much of that for tracing and for compiling."""
        if self.file is None:
            return
        kept, found = self.kept, dict(self.known)
        for stage, key in self.keys.items():
            made = sum(of[stage] for of in programs.values())
            if 2 * made < seconds[stage]:  # or what is left between two threads' compilers says little
                found[self.workers[stage]] = (seconds[stage] - made) / self.work[stage]
            # What was compiled now is read the next time.
            found[key] = kept[stage] if programs["compile"][stage] > kept[stage] + 0.5 else made
        with suppress(InputError):  # a full disk may not undo a finished job
            write_text(self.file, json.dumps(found))

    def _slowness(self) -> dict[str, float]:
        """Of who works in each stage on this machine, against the model's; by calibration until a job has told."""
        known = {stage: self.known.get(worker) for stage, worker in self.workers.items()}
        return {stage: _calibration() if slowness is None else slowness for stage, slowness in known.items()}


def _programs(config: ReconstructConfig, *, kept: bool, upsampled: bool) -> dict[str, float]:
    """Seconds by stage for a job's programs, compiled or kept."""
    total = dict(_KEPT if kept else _COMPILED)
    total["read"] += _OF_FINER[kept] * _by_network(config, upsampled)
    total["write"] += _OF_VIEWS[kept] * (config.input.views is not None)
    for table, share in ((_OF_ESTIMATE, config.asks_network), (_OF_A_PATH, min(_restored(config), 1.0))):
        for stage, seconds in table.items():
            total[stage] += share * seconds[kept]
    return total


def _by_network(config: ReconstructConfig, upsampled: bool) -> bool:
    """Whether a network makes the picture finer."""
    return upsampled and config.input.upsample == LEARNED


def _restored(config: ReconstructConfig) -> float:
    """Paths that are restored: all, or as many as on average."""
    if config.explore.min_revealed == 0:
        return config.explore.trajectories
    return _OPENS * (config.input.distance is None)


def _work(config: ReconstructConfig, rows: int, *, upsampled: bool) -> dict[str, float]:
    """Seconds of each stage without its programs, by the model, at so many working rows."""
    pixels, restored = (2 * r * r / 1e6 for r in (rows, config.restore.height))  # million
    paths, open_ones = config.explore.trajectories, _restored(config)
    made_finer = 20 * pixels * _by_network(config, upsampled)
    frames = min(_WAY / config.explore.step, config.explore.max_frames)
    by_network = restore_seconds(config, frames)
    views, film = 24 if config.input.views else 0, config.film.width * config.film.height / 1e6
    gaussians, view = _gaussians(config, rows), config.refine.views.size**2 / 1e6
    size, around = 0.02 + 0.13 * gaussians, 0.05 + 0.7 * gaussians  # to render a small picture of the scene; a panorama
    # A step sees what may change, all or some tenth, and of the rest no more than its views can tell apart.
    fitted = 0.1 * gaussians + min(0.9 * gaussians, STILL_OF_A_PIXEL * 6 * view)
    step = 0.01 + 3 * view + 0.8 * (fitted if config.refine.freeze_observed else gaussians)
    return {
        "read": 0.5 + 0.8 * pixels + made_finer + 1.2 * config.asks_network,
        "lift": 0.3 + 2.2 * pixels,
        "explore": 0.1,
        "peel": 0.3 + 3 * restored + 0.3 * pixels if config.peel.room else 0.2,
        "restore": paths * (0.1 + around) + open_ones * frames * (2 * around + restored) + by_network,
        "refine": 0.3 + min(open_ones, 1.0) * config.refine.steps * config.refine.batch * step,
        "write": 2.0 + 6 * gaussians + (20 + frames * paths) * (size + 0.1 * film) + 6 * around + 2 * views * size,
    }


def _gaussians(config: ReconstructConfig, rows: int) -> float:
    """Million, at most."""
    return config.lift.share * 2 * rows * rows / 1e6


def _keys(config: ReconstructConfig, rows: int, *, upsampled: bool) -> dict[str, str]:
    """What each stage's programs depend on, hashed: compiler, sizes and settings, not which picture it is."""
    compiler = (jax.__version__, os.environ.get("XLA_FLAGS", ""))
    budget = dataclasses.replace(config.budget, seconds=0.0)
    plain = dataclasses.replace(config, input=InputConfig(), output="", seed=0, budget=budget)
    of_input = dataclasses.replace(config.input, panorama="", distance=config.input.distance and "given", views=None)
    depends = {stage: (compiler, rows, plain) for stage in COUNTED}
    depends["read"] = (compiler, rows, upsampled, of_input, config.depth, config.shell)
    return {stage: f"{stage} {_hash(on)}" for stage, on in depends.items()}


def _workers(config: ReconstructConfig, *, upsampled: bool) -> dict[str, str]:
    """Who does each stage's work, hashed: a machine that is slow for a small network need not be for a large one."""
    by_diffusion = config.restore.method == DIFFUSION
    restorer = (config.restore.method, config.restore.diffusion.network if by_diffusion else None)
    who = dict.fromkeys(COUNTED) | {"restore": restorer, "peel": restorer if config.peel.room else None}
    who["read"] = (config.input.distance is None, config.input.upsample if upsampled else NONE)
    return {stage: f"{stage} by {_hash((_MODEL, worker))}" for stage, worker in who.items()}


def _hash(of) -> str:
    return hashlib.sha256(repr(of).encode()).hexdigest()[:16]


def recalled(file: Path) -> dict[str, float]:
    """What a `SecondsForecast` kept: slowness by stage and worker, seconds for programs; {} for no such file."""
    try:
        found = json.loads(file.read_text("utf-8"))
        return found if all(isinstance(number, float) for number in found.values()) else {}
    except (OSError, ValueError, TypeError, AttributeError):
        return {}  # nothing is kept yet, or by another version


@cache
def _calibration() -> float:
    """How slow this machine is against the model's, by a little work on two cores; measured once, that forecasts of one
    job be comparable. A sum that waits for itself: NumPy's sort takes eight times as long on processors that scatter
    slowly. Where others' work is beside it, half of what that costs now, in logarithms: it comes and goes."""
    started, used = time.perf_counter(), time.process_time()
    with ThreadPoolExecutor(2) as both:
        list(both.map(_sums, range(2)))
    wall, cpu = time.perf_counter() - started, time.process_time() - used
    return cpu / _CALIBRATED * max(2 * wall / cpu, 1.0) ** 0.5


def _sums(_) -> None:
    ones = np.ones(1 << 18, np.float32)
    for _ in range(300):
        np.cumsum(ones)
