"""Finished stages on disk: saved whole or not at all, and used again only for the very same job."""

import dataclasses
import hashlib
import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import jax
import numpy as np

from experiments.compile_clock import program_seconds
from rein3d_jax import __version__
from rein3d_jax.depth.level import Lean
from rein3d_jax.errors import InputError
from rein3d_jax.explore.trajectories import Trajectories
from rein3d_jax.io.files.checkpoint import load, save
from rein3d_jax.pipeline.explore_and_restore import Explored
from rein3d_jax.refine import RefineConfig, Snapshot, blank_snapshot
from rein3d_jax.scene import Gaussians, Panorama, Video

UNFINISHED = "unfinished"  # what the stage being made has so far


def blank_stages(refine: RefineConfig) -> dict[str, Any]:
    """Each stage's result, as a pytree of its structure and dtypes with which to read one back, by its file's name."""
    scene, snapshot = _blank(Gaussians, alive=bool), blank_snapshot(refine)
    video, number, share = _blank(Video), _leaf(np.int32), _leaf(np.float32)
    return {
        # whether its distance was estimated, what was done to a given one, how it leaned
        "read": (_blank(Panorama, valid=bool), np.zeros(0, bool), "", _blank(Lean)),
        "lift": scene,
        "peel": scene,
        "explore": _blank(Trajectories, counts=np.int32, overflow=np.int32),
        "restore": Explored(scene, video, number, share, number, number),
        "refine": (scene, snapshot.curves, ""),  # and why it ended
        UNFINISHED: snapshot,
    }


def _blank(struct_type, **dtypes):
    names = [field.name for field in dataclasses.fields(struct_type)]
    return struct_type(**{name: _leaf(dtypes.get(name, np.float32)) for name in names})


def _leaf(dtype) -> jax.ShapeDtypeStruct:
    return jax.ShapeDtypeStruct((0,), dtype)


@dataclasses.dataclass(frozen=True)
class Finished:
    """A stage that has its result."""

    name: str
    seconds: float  # that it took when it was made
    found: bool  # made by an earlier job
    programs: dict[str, float]  # seconds of these for tracing and for compiling; none where it was found


class StageStore:
    """A folder of stage results. A stage's key hashes all that its result depends on: the key of the stage before and
    its own settings. With `resume`, a result under the same key is read instead of made."""

    def __init__(self, folder: Path, refine: RefineConfig, *, resume: bool):
        self.folder, self.resume, self.blanks = folder, resume, blank_stages(refine)
        self.finished: list[Finished] = []
        self.key = __version__  # what another version of this package made is made again

    def run(self, name: str, depends: Any, make: Callable[[], Any]) -> Any:
        """The result of stage `name` ("restore-03" is one of the kind "restore"): read if finished, else made and
        saved."""
        self.key = hashlib.sha256(json.dumps([self.key, name, depends], sort_keys=True).encode()).hexdigest()
        path, like = self.folder / f"{name}.npz", self.blanks[name.split("-")[0]]
        stored = self._stored(path, like) if self.resume else None
        found = stored is not None
        programs = program_seconds()
        if not found:
            started = time.perf_counter()
            result = make()
            self._save(path, result, time.perf_counter() - started)
            (self.folder / f"{UNFINISHED}.npz").unlink(missing_ok=True)
            # A fresh run goes on with what a resumed one would read: the same bytes either way.
            stored = load(path, _shape(like))
        self._finish(name, float(stored["seconds"]), programs, found=found)
        return stored["result"]

    @contextmanager
    def timed(self, name: str) -> Iterator[None]:
        """Counts what is done within as a stage, of which nothing is saved."""
        programs, started = program_seconds(), time.perf_counter()
        yield
        self._finish(name, time.perf_counter() - started, programs, found=False)

    def _finish(self, name: str, seconds: float, programs_before: dict[str, float], *, found: bool) -> None:
        programs = {kind: total - programs_before[kind] for kind, total in program_seconds().items()}
        self.finished.append(Finished(name, seconds, found, programs))

    def save_unfinished(self, snapshot: Snapshot) -> None:
        """What the stage being made has so far, for `unfinished`."""
        self._save(self.folder / f"{UNFINISHED}.npz", snapshot, 0.0)

    def unfinished(self) -> Snapshot | None:
        """What `save_unfinished` had of the very stage being made, or None."""
        stored = self._stored(self.folder / f"{UNFINISHED}.npz", self.blanks[UNFINISHED]) if self.resume else None
        return None if stored is None else stored["result"]

    def seconds(self) -> dict[str, float]:
        """By kind of stage."""
        return self._summed(lambda stage: stage.seconds)

    def programs(self) -> dict[str, dict[str, float]]:
        """{"trace", "compile"}: of these seconds, by kind of stage."""
        return {part: self._summed(lambda stage, part=part: stage.programs[part]) for part in program_seconds()}

    def _summed(self, of: Callable[[Finished], float]) -> dict[str, float]:
        total: dict[str, float] = {}
        for stage in self.finished:
            kind = stage.name.split("-")[0]
            total[kind] = total.get(kind, 0.0) + of(stage)
        return total

    def _save(self, path: Path, result: Any, seconds: float) -> None:
        save(path, {"key": self._digest(), "result": result, "seconds": np.float64(seconds)})

    def _digest(self) -> np.ndarray:
        return np.frombuffer(bytes.fromhex(self.key), np.uint8)

    def _stored(self, path: Path, like: Any) -> dict | None:
        """What is stored, if it is this very stage's; anything else is made again."""
        if not path.exists():
            return None
        try:
            stored = load(path, _shape(like))
        except InputError:
            return None  # damaged, or shaped by another version
        return stored if np.array_equal(stored["key"], self._digest()) else None


def _shape(like: Any) -> dict:
    return {"key": np.zeros(0, np.uint8), "result": like, "seconds": np.float64(0)}


def read_stage(path: Path, like: Any) -> Any:
    """The result in a stage's file, whichever job's it is. Raises InputError where it is missing or damaged."""
    return load(path, _shape(like))["result"]
