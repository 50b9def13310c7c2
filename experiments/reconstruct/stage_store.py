"""Finished stages on disk: saved whole or not at all, and used again only for the very same job."""

import hashlib
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.checkpoint import load, save

PART = "unfinished.npz"


class StageStore:
    """A folder of stage results. A stage's key hashes all that its result depends on: the key of the stage before and
    its own config. With `resume`, a result under the same key is read instead of made."""

    def __init__(self, folder: Path, *, resume: bool, on_done: Callable[[str, float, bool], None]):
        self.folder, self.resume, self.on_done = folder, resume, on_done
        self.seconds: dict[str, float] = {}  # by the name's part before "-"
        self.each: dict[str, float] = {}
        self.key = ""

    def run(self, name: str, depends: Any, like: Any, make: Callable[[], Any]) -> Any:
        """The result of stage `name`, a pytree shaped as `like`: read if finished, else made and saved."""
        self.key = hashlib.sha256(json.dumps([self.key, name, depends], sort_keys=True).encode()).hexdigest()
        path = self.folder / f"{name}.npz"
        digest = self._digest()
        found = self._finished(path, digest, like) if self.resume else None
        if found is None:
            started = time.perf_counter()
            result = make()
            save(path, {"key": digest, "result": result, "seconds": np.float64(time.perf_counter() - started)})
            (self.folder / PART).unlink(missing_ok=True)
        # A fresh run goes on with what a resumed one would read: the same bytes either way.
        stored = found or load(path, self._shape(digest, like))
        spent = float(stored["seconds"])
        part = name.split("-")[0]
        self.seconds[part] = self.seconds.get(part, 0.0) + spent
        self.each[name] = spent
        self.on_done(name, spent, found is not None)
        return stored["result"]

    def keep(self, part: Any) -> None:
        """Save what the stage being made has so far, for `kept`."""
        save(self.folder / PART, {"key": self._digest(), "result": part, "seconds": np.float64(0)})

    def kept(self, like: Any) -> Any | None:
        """What `keep` saved of the very stage being made, shaped as `like`, or None."""
        stored = self._finished(self.folder / PART, self._digest(), like) if self.resume else None
        return None if stored is None else stored["result"]

    def _digest(self) -> np.ndarray:
        return np.frombuffer(bytes.fromhex(self.key), np.uint8)

    def _finished(self, path: Path, digest: np.ndarray, like: Any) -> dict | None:
        """What is stored, if it is this very stage's; anything else is made again."""
        if not path.exists():
            return None
        try:
            stored = load(path, self._shape(digest, like))
        except InputError:
            return None  # damaged, or shaped by another version
        return stored if np.array_equal(stored["key"], digest) else None

    @staticmethod
    def _shape(digest: np.ndarray, like: Any) -> dict:
        return {"key": digest, "result": like, "seconds": np.float64(0)}
