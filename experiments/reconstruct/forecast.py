"""What a job will take: seconds by stage, foreseen from its sizes, corrected by what jobs took on this machine before.

A stage takes its share of the work, and makes its programs: compiled the first time, read from the cache afterwards.
The model's numbers are those of one core of a 2.5 GHz Xeon; a short calibration says how fast this machine is, until a
job has told by stage.
"""

import dataclasses
import hashlib
import json
import time
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
from rein3d_jax.restore.restorer import DIFFUSION
from rein3d_jax.upsample import LEARNED, NONE

COUNTED = ("read", "lift", "explore", "peel", "restore", "refine", "write")
# Seconds for programs, compiled and kept.
_COMPILED = dict(zip(COUNTED, (18.0, 17.0, 0.7, 38.0, 7.0, 2.0, 18.0), strict=True))
_KEPT = dict(zip(COUNTED, (2.0, 2.2, 0.1, 4.5, 1.0, 0.5, 2.5), strict=True))
_NETWORK = 2.4  # seconds for the depth network
_CALIBRATED = 0.072  # seconds that `_calibration` takes on the model's machine
_WAY = 6.0  # metres of a path, on average


class SecondsForecast:
    """The seconds of one job; the file beside the kept programs remembers what jobs took."""

    def __init__(self, config: ReconstructConfig, rows: int, *, upsampled: bool):
        self.work, self.keys = _work(config, rows, upsampled=upsampled), _keys(config, rows, upsampled=upsampled)
        self.workers = _workers(config, upsampled=upsampled)
        self.looks = 1.5 if config.input.distance is None else 1.0  # the network's programs are read's, too
        folder = jax.config.jax_compilation_cache_dir
        self.file = None if folder is None else Path(folder) / "seconds.json"
        self.known = {} if self.file is None else recalled(self.file)

    def seconds(self) -> dict[str, float]:
        """By stage, and their total."""
        slowness, compiled = self._slowness(), self._programs(_COMPILED)
        programs = {stage: self.known.get(key, compiled[stage]) for stage, key in self.keys.items()}
        found = {stage: round(slowness[stage] * self.work[stage] + programs[stage], 1) for stage in COUNTED}
        return found | {"total": round(sum(found.values()), 1)}

    def remember(self, seconds: dict[str, float], programs: dict[str, dict[str, float]]) -> None:
        """Keeps what a whole job took by stage, and how much of that for tracing and for compiling."""
        if self.file is None:
            return
        kept, found = self._programs(_KEPT), dict(self.known)
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
        otherwise = _calibration() / _CALIBRATED if None in known.values() else 1.0
        return {stage: otherwise if slowness is None else slowness for stage, slowness in known.items()}

    def _programs(self, table: dict[str, float]) -> dict[str, float]:
        return table | {"read": self.looks * table["read"]}


def _work(config: ReconstructConfig, rows: int, *, upsampled: bool) -> dict[str, float]:
    """Seconds of each stage without its programs, by the model, at so many working rows."""
    pixels, restored = (2 * r * r / 1e6 for r in (rows, config.restore.height))  # million
    paths, every = config.explore.trajectories, config.explore.min_revealed == 0
    made_finer = 31 * pixels if config.input.upsample == LEARNED and upsampled else 0.0
    frames = min(_WAY / config.explore.step, config.explore.max_frames)
    by_network = restore_seconds(config, frames)
    views, film = 24 if config.input.views else 0, config.film.width * config.film.height / 1e6
    size = 0.02 + 0.16 * config.lift.share * pixels  # to render a small picture of the scene
    step = 0.03 + 4 * config.refine.views.size**2 / 1e6
    return {
        "read": 0.7 + 2 * pixels + made_finer + _NETWORK * (config.input.distance is None),
        "lift": 0.3 + 1.0 * pixels,
        "explore": 0.1,
        "peel": 0.3 + 4 * restored if config.peel.room else 0.2,
        "restore": paths * (0.1 + size + restored + every * frames * (size + 4 * restored)) + by_network,
        "refine": 0.3 + every * config.refine.steps * config.refine.batch * step,
        "write": 2.0 + (20 + frames * paths) * (size + 0.1 * film) + 2 * views * size,
    }


def _keys(config: ReconstructConfig, rows: int, *, upsampled: bool) -> dict[str, str]:
    """What each stage's programs depend on, hashed: the sizes and settings, not which picture it is."""
    budget = dataclasses.replace(config.budget, seconds=0.0)
    plain = dataclasses.replace(config, input=InputConfig(), output="", seed=0, budget=budget)
    of_input = dataclasses.replace(config.input, panorama="", distance=config.input.distance and "given", views=None)
    depends = {stage: (jax.__version__, rows, plain) for stage in COUNTED}
    depends["read"] = (jax.__version__, rows, upsampled, of_input, config.depth, config.shell)
    return {stage: f"{stage} {_hash(on)}" for stage, on in depends.items()}


def _workers(config: ReconstructConfig, *, upsampled: bool) -> dict[str, str]:
    """Who does each stage's work, hashed: a machine that is slow for a small network need not be for a large one."""
    by_diffusion = config.restore.method == DIFFUSION
    restorer = (config.restore.method, config.restore.diffusion.network if by_diffusion else None)
    who = dict.fromkeys(COUNTED) | {"restore": restorer, "peel": restorer if config.peel.room else None}
    who["read"] = (config.input.distance is None, config.input.upsample if upsampled else NONE)
    return {stage: f"{stage} by {_hash(worker)}" for stage, worker in who.items()}


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
    """Seconds of a little work of the kind that jobs do; measured once, that forecasts of one job be comparable."""
    numbers, started = np.linspace(0, 1e4, 1 << 20, dtype=np.float32), time.perf_counter()
    for _ in range(16):
        np.sort(np.sin(numbers))
    return time.perf_counter() - started
