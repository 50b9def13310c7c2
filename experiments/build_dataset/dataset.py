"""A dataset of pairs in shards. A shard is a function of the config and its number alone, so any number of workers
writes the same bytes, and a run that was killed goes on with the shards that are not whole."""

import dataclasses
import hashlib
import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import jax

from experiments.build_dataset.pair_scenes import SceneConfig, pair_sources
from experiments.config import dump_config
from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.io.files.json_file import read_json
from rein3d_jax.io.pairs.pair_shard import MANIFEST, SUFFIX, shard_fault, write_shard
from rein3d_jax.pipeline.pairs import PairConfig
from rein3d_jax.scene import Pair
from rein3d_jax.settings import Settings, setting

_CONFIG = "config.toml"


@dataclasses.dataclass(frozen=True)
class DatasetConfig(Settings):
    """A dataset of pairs of clips: what it holds, and where."""

    output: str = setting("runs/pairs", "folder of the shards; all machines that build must share it")
    clips: int = setting(64, "clips of the whole dataset", within="[1, inf)")
    clips_per_shard: int = setting(8, "clips of a shard, the unit of work of a worker", within="[1, inf)")
    seed: int = setting(0, "clip i is a function of it and i", within="[0, 4294967295]")
    scenes: SceneConfig = SceneConfig()
    pairs: PairConfig = PairConfig()

    @property
    def shards(self) -> int:
        """Number of shards; the last may be smaller."""
        return -(-self.clips // self.clips_per_shard)


def build_part(config: DatasetConfig, worker: int = 0, workers: int = 1, say: Callable[[str], None] = print) -> None:
    """Builds the shards worker, worker + workers, ... that are not whole yet, and the manifest once all are.

    A clip whose scene has no path for it is left out, and named with the reason in its shard's JSON and the manifest.
    Raises InputError where the folder holds a dataset of another config, and where no clip could be made at all.
    """
    folder, text = Path(config.output), _identity(config)
    _claim(folder / _CONFIG, text)
    digest = hashlib.sha256(text.encode()).hexdigest()
    sources = pair_sources(config.scenes, config.pairs, config.clips)
    for number in range(worker, config.shards, workers):
        path, begun = shard_path(folder, number, config), time.perf_counter()
        described, fault = _described(path, digest), None
        if described is not None and (fault := shard_fault(path, described)) is None:
            say(f"shard {number + 1}/{config.shards}: whole already")
            continue
        if fault:
            say(f"{fault}; it is built again")
        about: dict[str, Any] = {"config": digest, "redraws": 0, "left_out": []}
        described = write_shard(path, _pairs(config, number, sources, about), about)
        spent = time.perf_counter() - begun
        left_out = f", {len(about['left_out'])} left out" if about["left_out"] else ""
        say(f"shard {number + 1}/{config.shards}: {described['clips']} clips in {spent:.1f} s{left_out}")
    write_manifest(config, digest, say)


def shard_path(folder: Path, number: int, config: DatasetConfig) -> Path:
    """Path of one shard's records."""
    return folder / f"pairs-{number:05d}-of-{config.shards:05d}{SUFFIX}"


def write_manifest(config: DatasetConfig, digest: str, say: Callable[[str], None]) -> None:
    """Writes the manifest if every shard is described: the last worker does, and any would write the same."""
    folder, shards = Path(config.output), []
    for number in range(config.shards):
        path = shard_path(folder, number, config)
        if (described := _described(path, digest)) is None:
            return
        shards.append({"file": path.name} | {name: x for name, x in described.items() if name != "config"})
    clips = sum(shard["clips"] for shard in shards)
    left_out = [line for shard in shards for line in shard["left_out"]]
    if not clips:
        raise InputError(f"no clip could be made: {left_out[0]}")
    manifest = {"clips": clips, "config": digest, "left_out": len(left_out), "shards": shards}
    write_text(folder / MANIFEST, json.dumps(manifest, indent=1) + "\n")
    say(f"{folder / MANIFEST}: {clips} clips in {config.shards} shards, {sum(s['bytes'] for s in shards) / 1e6:.1f} MB")


def _pairs(config: DatasetConfig, number: int, sources: Callable, about: dict[str, Any]) -> Iterator[Pair]:
    first = number * config.clips_per_shard
    for index in range(first, min(first + config.clips_per_shard, config.clips)):
        name, draw = sources(index)
        try:
            drawn = draw(jax.random.fold_in(jax.random.key(config.seed), index))
        except InputError as error:
            if config.scenes.folder is None:  # rooms are drawn until one will do: that none does is the config's fault
                raise
            about["left_out"].append(f"clip {index} in {name}: {error}")
            continue
        about["redraws"] += int(drawn.draws) - 1
        yield drawn.pair


def _identity(config: DatasetConfig) -> str:
    """The recipe but for the place where it is written: the same dataset may lie in two folders."""
    return dump_config(dataclasses.replace(config, output=""))


def _claim(path: Path, text: str) -> None:
    if path.exists() and path.read_text("utf-8") != text:
        raise InputError(f"{path.parent} holds a dataset of another config ({path}): choose another output")
    write_text(path, text)


def _described(path: Path, digest: str) -> dict[str, Any] | None:
    """What the shard's JSON says, if it is whole and this config's."""
    try:
        described = read_json(path.with_suffix(".json"))
    except InputError:
        return None
    return described if isinstance(described, dict) and described.get("config") == digest else None
