"""paper.toml is the paper, and paper_small.toml the same in the small: every stage of it runs, weights and all."""

import dataclasses
import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from experiments.config import RECIPES, load_config
from experiments.random_weights.__main__ import main as random_weights
from experiments.reconstruct.__main__ import main as reconstruct
from experiments.reconstruct.config import ReconstructConfig
from experiments.train_restore.__main__ import main as train_restore
from rein3d_jax.io.pairs.pair_shard import MANIFEST, write_shard
from rein3d_jax.scene import Pair, Video

SIZES = (int, float, list)  # what may differ: how many and how large, and where files are
FILES = {"output", "weights", "views", "folder"}
NETWORK = ("network", "film")  # the small one's own: the network's sizes, and a short film


def keys_of(table: dict, path: tuple[str, ...] = ()) -> dict[tuple[str, ...], object]:
    found = {}
    for name, value in table.items():
        found |= keys_of(value, (*path, name)) if isinstance(value, dict) else {(*path, name): value}
    return found


def recipe(name: str) -> dict[tuple[str, ...], object]:
    return keys_of(tomllib.loads((RECIPES / f"{name}.toml").read_text("utf-8")))


@pytest.mark.parametrize(("large", "small"), [("paper", "paper_small"), ("paper_train", "paper_small_train")])
def test_the_small_recipe_names_the_papers_keys_and_differs_in_sizes_alone(large, small):
    large, small = recipe(large), recipe(small)
    assert large.keys() <= small.keys()
    for key, value in large.items():
        if key[-1] not in FILES and "network" not in key and (isinstance(value, bool) or not isinstance(value, SIZES)):
            assert small[key] == value, key
    more = [key for key in small.keys() - large.keys() if not set(NETWORK) & set(key) and "sampl" not in str(key)]
    assert not more


def test_the_papers_numbers():
    """Sec. 4.2, 5.1 and Table 3dgs_refine_details."""
    config = load_config(ReconstructConfig, RECIPES / "paper.toml")
    restore, refine, sample = config.restore, config.refine, config.restore.diffusion.sample
    assert (restore.method, restore.height, restore.sequential, restore.fuse_every) == ("diffusion", 448, False, 0)
    assert (config.explore.max_frames, sample.windows.frames, sample.noise) == (41, 41, "paper")
    assert (config.rasterize.near, config.rasterize.far, config.rasterize.antialias) == (0.01, 100.0, True)
    assert (refine.batch, refine.steps, refine.evaluate_every, refine.views.held_out_every) == (4, 15_000, 5_000, 16)
    densify, rates = refine.densify, refine.rates
    assert (refine.sh_degree, refine.loss.ssim, refine.densification) == (3, 0.2, "default")
    assert (densify.start, densify.stop, densify.every, densify.reset_every) == (500, 13_000, 100, 3_000)
    assert densify.prune_opacity == 0.005
    assert (rates.means, rates.scales, rates.opacities, rates.quats) == (1.6e-4, 5e-3, 5e-2, 1e-3)
    assert (rates.sh, rates.sh_rest) == (2.5e-3, 1.25e-4)
    assert not any(dataclasses.astuple(config.peel)) and config.upsample.method == "learned"


def test_without_weights_it_is_refused_in_one_line_before_anything_is_written(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert reconstruct(["--config", "paper"]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "restore.weights runs/wan_paper/weights" in said and "paper_train" in said
    assert not list(tmp_path.iterdir())


def test_weights_of_another_size_are_refused_as_early(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert random_weights(["--output", "small"]) == 0
    assert random_weights(["--output", "small"]) == 2
    assert reconstruct(["--config", "paper", "--set", 'restore.weights="small"']) == 2
    said = capsys.readouterr().err
    assert "small holds a transformer already" in said
    assert "small/transformer lacks" in said and "and " in said.splitlines()[-1] and not Path("runs").exists()


def write_pairs(folder: Path) -> None:
    """Three pairs of 5 frames of 64 x 128."""
    folder.mkdir(parents=True)
    random, shape = np.random.default_rng(0), (5, 64, 128)
    poses, ones = np.tile(np.eye(4, dtype=np.float32), (5, 1, 1)), np.ones(shape, np.float32)

    def pair():
        alpha, rgb = (random.random(shape) < 0.8).astype(np.float32), random.random((*shape, 3), np.float32)
        return Pair(Video(rgb, ones, ones, poses), Video(rgb * alpha[..., None], alpha, alpha, poses))

    described = write_shard(folder / "s.array_record", (pair() for _ in range(3)), {})
    (folder / MANIFEST).write_text(json.dumps({"shards": [{"file": "s.array_record"} | described]}))


@pytest.mark.slow
def test_the_chain_of_weights_a_training_step_and_a_scene(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_pairs(tmp_path / "runs" / "pairs_small")
    assert random_weights(["--output", "runs/wan_small/weights"]) == 0
    assert train_restore(["--config", "paper_small_train"]) == 0
    changed = ["--set", "restore.weights=runs/wan_small_trained/weights", "--set", "explore.trajectories=1"]
    assert reconstruct(["--config", "paper_small", *changed]) == 0
    assert "1 x 5 frames at most, 4 steps without guidance, 4 passes a path" in capsys.readouterr().out
    run = tmp_path / "runs" / "paper_small"
    with np.load(run / "stages" / "restore-00.npz") as stage:
        restored = stage["['result'].video.rgb"]
    assert restored.shape[1:] == (128, 256, 3) and np.isfinite(restored).all()
    metrics = json.loads((run / "metrics.json").read_text("utf-8"))
    assert metrics["count"]["refined"] > 8_000  # a ball for each of 64 x 128 pixels, but for those too faint
    assert all((run / name).exists() for name in ("viewer.html", "report.html", "scene.ply", "flythrough.mp4"))
