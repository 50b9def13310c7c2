"""Shards of a dataset of pairs: ArrayRecord files, and beside each a JSON that says what it must hold.

    NAME.array_record   records of pair_record.py
    NAME.json           {"clips": count, "sha256": of the file, "bytes": its size, ...what the builder adds}

The JSON is written last: a shard without one is unfinished.
"""

import hashlib
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import atomic_path, write_text
from rein3d_jax.io.files.input_file import require_file
from rein3d_jax.io.files.json_file import read_json
from rein3d_jax.io.pairs.pair_record import decode_pair, encode_pair
from rein3d_jax.scene import Pair

SUFFIX = ".array_record"
MANIFEST = "manifest.json"
_OPTIONS = "group_size:1"  # each record can be read alone; compressed by zstd


def write_shard(path: Path, pairs: Iterable[Pair], about: dict[str, Any]) -> dict[str, Any]:
    """Writes the pairs to `path` (NAME.array_record) one at a time, then NAME.json with `about` in it, filled while
    `pairs` is drawn from; returns that. What an interrupted run left behind under either name is removed."""
    records, clips = _array_record(), 0
    for left in path.parent.glob(f".{path.stem}.*"):
        left.unlink(missing_ok=True)
    with atomic_path(path) as temporary:
        writer = records.ArrayRecordWriter(str(temporary), _OPTIONS)
        for pair in pairs:
            writer.write(encode_pair(pair))
            clips += 1
        writer.close()
        described = {"clips": clips, "sha256": _sha256(temporary), "bytes": temporary.stat().st_size, **about}
    write_text(path.with_suffix(".json"), json.dumps(described, indent=1) + "\n")
    return described


def shard_fault(path: Path, described: dict[str, Any]) -> str | None:
    """One line about what is wrong with the shard at `path` by its description, or None."""
    try:
        size = path.stat().st_size
    except OSError as error:
        return f"{path} is missing ({error.strerror})"
    if size != described.get("bytes"):
        return f"{path} has {size} bytes, not {described.get('bytes')}: it was cut off or changed"
    return None if _sha256(path) == described.get("sha256") else f"{path} does not have its checksum: it is damaged"


class PairDataset(Sequence):
    """The pairs of a dataset's folder by number, as float32 NumPy arrays. What Grain calls a random access source."""

    def __init__(self, folder: str | Path):
        """Raises InputError where there is no manifest, or a shard is missing or of another size."""
        self.folder = Path(folder)
        path = self.folder / MANIFEST
        require_file(path)
        try:
            self.shards = [(self.folder / s["file"], s) for s in read_json(path)["shards"]]
            self.places = [(number, i) for number, (_, s) in enumerate(self.shards) for i in range(s["clips"])]
        except (KeyError, TypeError) as error:
            raise InputError(f"{path} is no dataset's manifest ({error}): build the dataset again") from error
        for shard, described in self.shards:
            if not shard.is_file() or shard.stat().st_size != described["bytes"]:
                raise InputError(f"{shard_fault(shard, described)}; {_MEND}")
        self._readers: dict[int, Any] = {}

    def __len__(self) -> int:
        return len(self.places)

    def __getitem__(self, index: int) -> Pair:
        """Raises InputError, naming the shard, for a record that is damaged."""
        number, record = self.places[index]
        path = self.shards[number][0]
        try:
            if number not in self._readers:
                self._readers[number] = _array_record().ArrayRecordReader(str(path))
            (data,) = self._readers[number].read([record])
        except (RuntimeError, IndexError, ValueError) as error:
            raise InputError(f"{path} is damaged at record {record}; {_MEND}") from error
        return decode_pair(data, f"{path}, record {record},")

    def __getstate__(self) -> dict:
        return {**self.__dict__, "_readers": {}}  # a reader cannot be sent to Grain's worker processes

    def faults(self) -> list[str]:
        """One line for each shard whose bytes are not those of the manifest."""
        return [fault for shard in self.shards if (fault := shard_fault(*shard)) is not None]


_MEND = "run experiments.build_dataset again: it builds that shard anew"


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _array_record() -> ModuleType:
    try:
        from array_record.python import array_record_module
    except ImportError as error:
        raise InputError("datasets need the package array-record: pip install 'rein3d-jax[data]'") from error
    return array_record_module
