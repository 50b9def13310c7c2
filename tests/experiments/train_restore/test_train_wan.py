"""Training the full-size network, in small: it changes what it may and nothing else, goes on where it was killed, and
what it wrote restores."""

import json
from dataclasses import replace
from pathlib import Path

import jax
import numpy as np
import pytest
from jax.sharding import NamedSharding, PartitionSpec

from experiments.config import dump_config, load_config
from experiments.train_restore.__main__ import main
from experiments.train_restore.config import OptimizerConfig
from experiments.train_restore.wan.config import PairDataConfig, WanTrainConfig
from experiments.train_restore.wan.data import open_pairs, pair_batch, pair_batches
from experiments.train_restore.wan.step import adapted, initial_wan_state, make_wan_step
from experiments.train_restore.wan.train import train_wan
from rein3d_jax.errors import InputError
from rein3d_jax.io.files.training_checkpoint import TrainingCheckpoints
from rein3d_jax.io.pairs.pair_shard import MANIFEST, write_shard
from rein3d_jax.networks.wan import random_wan, read_wan, write_wan
from rein3d_jax.parallel import data_mesh, data_parallel
from rein3d_jax.restore.wan.config import DitConfig, VaeConfig, WanConfig
from rein3d_jax.restore.wan.restore import SampleConfig
from rein3d_jax.restore.wan.training.lora import LoraConfig
from rein3d_jax.restore.wan.training.trainable import TrainableConfig
from rein3d_jax.scene import Pair, Video

pytestmark = pytest.mark.slow  # whole trainings

FRAMES, HEIGHT, WIDTH, PAIRS = 5, 32, 64, 4
RECIPES = Path(__file__).parents[3] / "experiments" / "recipes"
# A stride of 4 pixels, so 16 channels of mask: the VAE is most of what has to be compiled.
NETWORK = WanConfig(
    DitConfig(1, 12, 16, depth=2, control_every=1, control_channels=48, text_dim=8, frequencies=16, dtype="float32"),
    VaeConfig(base=2, multipliers=(1, 1, 1), blocks=1, halve_time=(True, True)),
)


def pair_of(seed, frames=FRAMES):
    rng = np.random.default_rng(seed)
    shape = (frames, HEIGHT, WIDTH)
    poses = np.tile(np.eye(4, dtype=np.float32), (frames, 1, 1))
    alpha = (rng.random(shape) < 0.8).astype(np.float32)
    rgb = rng.random((*shape, 3), np.float32)
    ones = np.ones(shape, np.float32)
    return Pair(Video(rgb, ones, 2 * ones, poses), Video(rgb * alpha[..., None], alpha, 2 * alpha, poses))


def write_pairs(folder, frames=FRAMES):
    path = folder / "s.array_record"
    described = write_shard(path, (pair_of(seed, frames) for seed in range(PAIRS)), {})
    (folder / MANIFEST).write_text(str({"shards": [{"file": path.name} | described]}).replace("'", '"'))
    return str(folder)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_pairs(tmp_path_factory.mktemp("pairs"))


def config_of(folder, output="", **options):
    return WanTrainConfig(
        output=str(output),
        steps=2,
        batch=2,
        accumulate=2,
        log_every=1,
        save_every=1,
        evaluate_every=2,
        network=NETWORK,
        sampling=SampleConfig(steps=1, guidance=1.0, solver="euler"),
        data=PairDataConfig(folder, held_out=1),
        optimizer=OptimizerConfig(rate=1e-2, warmup=0),
        **{"trainable": TrainableConfig("adapter")} | options,
    )


def same(a, b):
    return all(np.array_equal(x, y) for x, y in zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=True))


def test_two_steps_killed_between_end_as_unbroken_change_the_adapter_alone_and_write_what_reads(folder, tmp_path):
    config = config_of(folder, tmp_path)
    mesh = data_mesh(config.devices)
    step = data_parallel(make_wan_step(config), mesh, axis=1)
    before, pairs = random_wan(config.seed, NETWORK), open_pairs(config)
    state = jax.device_put(
        jax.tree.map(np.asarray, initial_wan_state(before, config)), NamedSharding(mesh, PartitionSpec())
    )
    state, _ = step(state, pair_batch(pairs, 0, config, 0, 1))
    with TrainingCheckpoints(tmp_path / "checkpoints") as checkpoints:
        checkpoints.save(1, state.train, -np.inf)  # so that the next one is the best
    unbroken, _ = step(state, pair_batch(pairs, 1, config, 0, 1))
    with pytest.raises(InputError, match="--resume"):
        train_wan(config)
    state = train_wan(config, resume=True)
    lines = (tmp_path / "log.jsonl").read_text().splitlines()
    assert {json.loads(line)["step"] for line in lines} == {2}  # step 1 was not taken again
    assert same(unbroken.train, state.train) and int(state.train.step) == 2 and int(state.train.skipped) == 0

    after = adapted(state.train.parameters, state.fixed, config)
    assert same(before.dit["steps"]["block_0"], after.dit["steps"]["block_0"]) and same(before.vae, after.vae)
    assert not same(before.dit["steps"]["hint"], after.dit["steps"]["hint"])
    assert (tmp_path / "samples" / "000002.png").exists()
    assert load_config(WanTrainConfig, tmp_path / "config.toml") == config
    written = adapted(state.train.average, state.fixed, config)
    assert same(read_wan(tmp_path / "weights", NETWORK), written)


def test_low_rank_pairs_go_through_a_checkpoint(folder, tmp_path):
    config = config_of(folder, trainable=TrainableConfig("lora", LoraConfig(rank=2)))
    train_state = initial_wan_state(random_wan(0, NETWORK), config).train
    with TrainingCheckpoints(tmp_path) as checkpoints:
        checkpoints.save(1, train_state, 0.0)
    with TrainingCheckpoints(tmp_path) as checkpoints:
        assert same(checkpoints.restore(1, jax.tree.map(np.zeros_like, train_state)), train_state)


def test_a_step_is_of_its_number_and_the_seed_and_every_pair_has_its_turn(folder):
    config = replace(config_of(folder), steps=5)
    pairs = open_pairs(config)
    later = list(pair_batches(pairs, 2, config))
    assert len(later) == 3 and same(later[1], pair_batch(pairs, 3, config, 0, 1))
    assert not same(later[1].seed, later[2].seed)
    whole, *halves = (pair_batch(pairs, 0, replace(config, accumulate=1), *share) for share in ((0, 1), (0, 2), (1, 2)))
    assert same(whole, jax.tree.map(lambda a, b: np.concatenate([a, b], axis=1), *halves))
    seen = [
        pair_batch(pairs, step, replace(config, batch=1, accumulate=1), 0, 1).rgb[0, 0] for step in range(PAIRS - 1)
    ]
    assert len({x.tobytes() for x in seen}) == PAIRS - 1  # once round: all but the one held out
    assert not any(same(x, pairs[0].degraded.rgb) for x in seen)


def test_what_cannot_be_trained_is_refused(folder, tmp_path, capsys):
    with pytest.raises(InputError, match="1 \\+ 4 n"):
        open_pairs(config_of(write_pairs(tmp_path, frames=4)))
    with pytest.raises(InputError, match="held_out takes 4"):
        open_pairs(replace(config_of(folder), data=PairDataConfig(folder, held_out=4)))
    huge = replace(config_of(folder), network=WanConfig(replace(DitConfig(), depth=3000)))
    with pytest.raises(InputError, match="smaller network"):
        train_wan(huge)
    (tmp_path / "recipe.toml").write_text(dump_config(huge))
    assert main(["--config", str(tmp_path / "recipe.toml"), "--set", "batch=3"]) == 2
    assert "accumulate" in capsys.readouterr().err


def test_the_papers_recipe_is_the_papers():
    config = load_config(WanTrainConfig, RECIPES / "paper_train.toml")
    assert (config.steps, config.batch, config.optimizer.rate, config.optimizer.cooldown) == (5000, 32, 5e-5, 0)
    assert config.network == WanConfig(DitConfig(remat=True), VaeConfig(dtype="bfloat16"))
    assert config.objective.latitude == 0.1


def test_a_folder_that_lacks_a_part_is_named(tmp_path):
    params = random_wan(0, NETWORK)
    write_wan(tmp_path, params, NETWORK)
    assert same(params, read_wan(tmp_path, NETWORK))
    (tmp_path / "text").rename(tmp_path / "words")
    with pytest.raises(InputError, match="no folder text"):
        read_wan(tmp_path, NETWORK)
