"""Datasets of pairs: the same bytes whatever the number of workers and however often interrupted; what is at fault is
said in a line."""

import hashlib
import json
import os
import signal
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import jax
import numpy as np
import pytest
import trimesh

from experiments.build_dataset import __main__ as build_dataset
from experiments.build_dataset import dataset, pair_scenes
from experiments.build_dataset.dataset import DatasetConfig, build_part, shard_path
from experiments.build_dataset.ray_workers import build_with_ray
from rein3d_jax.errors import InputError
from rein3d_jax.io.pairs.pair_shard import PairDataset
from rein3d_jax.pipeline.pairs import Drawn
from rein3d_jax.scene import Pair, Video

RECIPE = "clips = 7\nclips_per_shard = 2\n"


def fake_pair(key) -> Pair:
    """A pair of noise by key: it costs nothing."""
    rgb = np.asarray(jax.random.uniform(key, (2, 8, 16, 3)))
    video = Video(rgb, rgb[..., 0], rgb[..., 1], np.tile(np.eye(4, dtype=np.float32), (2, 1, 1)))
    return Pair(video, video)


def sources_of(fails=()):
    """Clips by key, but for those in `fails`, whose scene has no path."""

    def clip(index):
        def draw(key):
            if index in fails:
                raise InputError("the longest straight path through its origin has 0.00 m")
            return Drawn(fake_pair(key), np.float32(5), np.int32(2), np.zeros(4))

        return f"scene {index}", draw

    return lambda scenes, pairs, clips: clip


@pytest.fixture
def config(tmp_path, monkeypatch):
    monkeypatch.setattr(dataset, "pair_sources", sources_of())
    return DatasetConfig(output=str(tmp_path / "pairs"), clips=7, clips_per_shard=2)


def silent(line):
    pass


def build(config, workers=1, say=silent):
    for worker in range(workers):
        build_part(config, worker, workers, say)
    return bytes_in(config.output)


def bytes_in(folder):
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in Path(folder).iterdir()}


def manifest_of(config):
    return json.loads((Path(config.output) / "manifest.json").read_text())


def at(config, tmp_path, name, **changes):
    return DatasetConfig(**{**vars(config), "output": str(tmp_path / name), **changes})


def test_any_number_of_workers_writes_the_same_bytes(config, tmp_path):
    one = build(config)
    assert len(one) == 4 * 2 + 2  # shards and their descriptions, config.toml, manifest.json
    assert build(at(config, tmp_path, "b"), workers=3) == one
    assert build(at(config, tmp_path, "c"), workers=9) == one  # more workers than shards
    assert len(PairDataset(config.output)) == 7
    redraws = [shard["redraws"] for shard in manifest_of(config)["shards"]]
    assert redraws == [2, 2, 2, 1]  # each fake took two draws


def test_the_manifest_waits_for_the_last_worker(config):
    build_part(config, 0, 2, silent)
    assert "manifest.json" not in bytes_in(config.output)
    build_part(config, 1, 2, silent)
    assert "manifest.json" in bytes_in(config.output)


def test_goes_on_after_any_interruption(config, tmp_path, monkeypatch):
    one, killed = build(config), at(config, tmp_path, "killed")
    for survives in (0, 1, 3, 4):  # clips made before each kill
        made = iter(range(survives))

        def clip(index, made=made):
            def draw(key):
                if next(made, None) is None:
                    raise KeyboardInterrupt
                return sources_of()(None, None, 7)(index)[1](key)

            return "scene", draw

        monkeypatch.setattr(dataset, "pair_sources", lambda *_, clip=clip: clip)
        with pytest.raises(KeyboardInterrupt):
            build_part(killed, say=silent)
    monkeypatch.setattr(dataset, "pair_sources", sources_of())
    assert build(killed) == one


@pytest.mark.parametrize("cut", [True, False])
def test_a_damaged_shard_is_named_and_built_again(config, cut):
    one, said = build(config), []
    path = shard_path(Path(config.output), 1, config)
    data = bytearray(path.read_bytes())
    data[-200] ^= 255
    path.write_bytes(data[:-100] if cut else data)
    again = build(config, say=said.append)
    assert again == one
    assert sum("00001-of-00004" in line and "built again" in line for line in said) == 1
    assert sum("whole already" in line for line in said) == 3


def test_another_config_is_refused(config):
    build(config)
    with pytest.raises(InputError, match="choose another output"):
        build_part(DatasetConfig(**{**vars(config), "seed": 1}), say=silent)


def test_a_scene_without_a_path_is_left_out_and_named(config, tmp_path, monkeypatch):
    monkeypatch.setattr(dataset, "pair_sources", sources_of(fails={2, 3, 6}))
    scenes = dataset.SceneConfig(folder="somewhere")
    build(config := at(config, tmp_path, "some", scenes=scenes))
    manifest = manifest_of(config)
    assert manifest["clips"] == len(PairDataset(config.output)) == 4 and manifest["left_out"] == 3
    assert "clip 3 in scene 3: the longest straight path" in manifest["shards"][1]["left_out"][1]
    monkeypatch.setattr(dataset, "pair_sources", sources_of(fails=set(range(7))))
    with pytest.raises(InputError, match="no clip could be made: clip 0"):
        build(at(config, tmp_path, "none", scenes=scenes))


@pytest.fixture
def recipe(config, tmp_path):
    path = tmp_path / "recipe.toml"
    path.write_text(f"output = {json.dumps(config.output)}\n{RECIPE}")
    return path


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--worker", "3/3"], "--worker 3/3: write it as I/N"),
        (["--ray", "0"], "--ray 0: at least 1"),
        (["--check"], "manifest.json"),
        (["--set", "pairs.height=100"], "pairs.height must be a multiple of rasterize.tile 8, not 100"),
        (["--set", "pairs.frames=1"], "pairs.frames must be in [2, inf), not 1"),
        (["--set", "clip=3"], "did you mean clips?"),
    ],
)
def test_faults_are_one_line(recipe, capsys, options, said):
    assert build_dataset.main(["--config", str(recipe), *options]) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1


def test_check_names_every_damaged_shard(recipe, config, capsys):
    assert build_dataset.main(["--config", str(recipe)]) == 0
    assert build_dataset.main(["--config", str(recipe), "--check"]) == 0
    for number in (0, 2):
        path = shard_path(Path(config.output), number, config)
        data = bytearray(path.read_bytes())
        data[100] ^= 1
        path.write_bytes(data)
    assert build_dataset.main(["--config", str(recipe), "--check"]) == 2
    error = capsys.readouterr().err
    assert "00000-of-00004" in error and "00002-of-00004" in error and "00001-of-00004" not in error


TINY = dataset.PairConfig(height=16, frames=3, speed=4.0)


@pytest.fixture
def scenes(tmp_path):
    """A folder of one house that has a path, and one that is too small for any."""
    folder = tmp_path / "scenes"
    folder.mkdir()
    trimesh.creation.box(extents=[5, 4, 3]).export(folder / "house.obj")
    trimesh.creation.box(extents=[1.0, 1.0, 3]).export(folder / "shaft.obj")
    return dataset.SceneConfig(folder=str(folder), up="z")


@pytest.mark.slow
def test_two_ray_workers_one_of_them_killed_write_what_one_process_does(scenes, tmp_path, monkeypatch):
    config = DatasetConfig(str(tmp_path / "one"), clips=4, clips_per_shard=1, scenes=scenes, pairs=TINY)
    one = build(config)
    manifest = manifest_of(config)
    assert manifest["clips"] == 2 and manifest["left_out"] == 2
    assert "shaft.obj" in manifest["shards"][3]["left_out"][0]
    monkeypatch.setenv("REIN3D_DATASET", str(tmp_path))  # by which its workers are known
    with ThreadPoolExecutor(1) as pool:
        killed = pool.submit(kill_a_worker, tmp_path)
        build_with_ray(DatasetConfig(**{**vars(config), "output": str(tmp_path / "two")}), 2)
    assert killed.result()
    assert bytes_in(tmp_path / "two") == one


def kill_a_worker(tmp_path) -> bool:
    """Once the first shard is there, a Ray process that is at work."""
    until = time.monotonic() + 240
    while time.monotonic() < until:
        if list((tmp_path / "two").glob("pairs-*.json")):
            for place in Path("/proc").glob("[0-9]*"):
                with suppress(OSError):
                    ours = f"REIN3D_DATASET={tmp_path}".encode() in (place / "environ").read_bytes()
                    if ours and (place / "cmdline").read_bytes().startswith(b"ray::_part"):
                        os.kill(int(place.name), signal.SIGKILL)
                        return True
        time.sleep(0.02)
    return False


def test_houses_give_a_place_for_each_room(tmp_path, monkeypatch):
    monkeypatch.setattr(pair_scenes, "room_names", lambda path: [f"{path.stem}-bed", f"{path.stem}-bath"])
    for name in ("b.json", "a.json", "c.glb", "readme.txt"):
        (tmp_path / name).touch()
    places = pair_scenes.scene_places(pair_scenes.SceneConfig(folder=str(tmp_path), models="3D-FUTURE-model"))
    assert [(path.name, room) for path, room in places] == [
        ("c.glb", None), ("a.json", "a-bed"), ("a.json", "a-bath"), ("b.json", "b-bed"), ("b.json", "b-bath"),
    ]  # fmt: skip
    (tmp_path / "c.glb").unlink()
    with pytest.raises(InputError, match=r"holds no \.glb"):  # without the models, houses are no scenes
        pair_scenes.scene_places(pair_scenes.SceneConfig(folder=str(tmp_path)))


@pytest.mark.slow
def test_a_worker_of_ray_says_what_is_at_fault(tmp_path):
    scenes = dataset.SceneConfig(folder=str(tmp_path / "nowhere"))
    with pytest.raises(InputError, match="nowhere is no folder"):
        build_with_ray(DatasetConfig(str(tmp_path / "two"), scenes=scenes), 1)
