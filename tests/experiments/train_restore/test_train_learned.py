"""Training the learned restorer, in small: examples and runs go on where they were killed, bad steps are skipped."""

import json
import struct
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import jax
import numpy as np
import pytest

from experiments.config import dump_config, load_config
from experiments.example_store import ExampleStore, write_examples
from experiments.train_restore.__main__ import main
from experiments.train_restore.config import GuardConfig, OptimizerConfig
from experiments.train_restore.learned.config import ExampleDataConfig, LearnedTrainConfig
from experiments.train_restore.learned.data import example_batch
from experiments.train_restore.learned.train import train_learned
from experiments.train_restore.run import TrainingRun
from rein3d_jax.errors import InputError
from rein3d_jax.networks.trained import read_network
from rein3d_jax.restore.learned.condition import CANDIDATES, Clip
from rein3d_jax.restore.learned.config import NetworkConfig
from rein3d_jax.restore.learned.loss import Example
from rein3d_jax.restore.restorer import RestoreConfig

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("one_step_a_config")]  # whole trainings

ROWS, FRAMES, COUNTED, STEPS = 16, 3, 6, 4


def example(index: int) -> Example:
    rng, shape = np.random.default_rng(index), (FRAMES, ROWS, 2 * ROWS)

    def values(*channels):
        return rng.random((*shape, *channels), np.float32)

    alpha = (values() < 0.7).astype(np.float32)
    alpha[0] = 1.0
    position = np.concatenate([np.zeros((1, 3)), rng.normal(size=(FRAMES - 1, 3))]).astype(np.float32)
    clip = Clip(values(3), alpha, (1 + values()) * alpha, values(CANDIDATES, 3), 1 + values(CANDIDATES), position)
    return Example(clip, values(3), 1 + values())


def write(folder, count=COUNTED, make=example):
    return list(write_examples(folder, make, count))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    write(path := tmp_path_factory.mktemp("examples"))
    return path


def config_of(folder, output, **options) -> LearnedTrainConfig:
    network = NetworkConfig(rows=ROWS, fine=8, width=8, depth=1, heads=1, expand=1)
    times = {"steps": STEPS, "log_every": 1, "save_every": 2, "evaluate_every": STEPS}
    parts = {"network": network, "optimizer": OptimizerConfig(rate=1e-2, warmup=0)}
    return LearnedTrainConfig(
        output=str(output), data=ExampleDataConfig(str(folder), frames=2, held_out=2), **times, **parts, **options
    )


@pytest.fixture(scope="module")
def unbroken(folder, one_step_a_config, tmp_path_factory):
    """(config, last state) of a run that nobody killed."""
    config = config_of(folder, tmp_path_factory.mktemp("run"))
    return config, train_learned(config)


def log_of(output) -> list[dict]:
    return [json.loads(line) for line in (output / "log.jsonl").read_text().splitlines()]


def test_writing_that_was_killed_goes_on_to_the_same_bytes_and_another_count_is_refused(folder, tmp_path):
    with pytest.raises(SystemExit):
        write(tmp_path, make=lambda index: example(index) if index < 3 else sys.exit())
    assert len(ExampleStore(tmp_path)) == 3  # a folder that is being written is read as far as it goes
    assert write(tmp_path) == [4, 5, 6]
    for count in (COUNTED - 2, COUNTED + 2):
        with pytest.raises(InputError, match="choose an empty output"):
            write(tmp_path, count=count)
    whole, resumed = ({path.name: path.read_bytes() for path in x.iterdir()} for x in (folder, tmp_path))
    assert resumed == whole


def test_examples_come_back_as_they_are_stored(folder):
    store = ExampleStore(folder)
    found, made = store.example(4, [0, 2]), example(4)
    np.testing.assert_allclose(found.clean_rgb, made.clean_rgb[[0, 2]], atol=0.5001 / 255)  # half of a byte's step
    np.testing.assert_allclose(found.clip.distance, made.clip.distance[[0, 2]], rtol=2**-11)  # float16
    np.testing.assert_array_equal(found.clip.position, made.clip.position[[0, 2]])


def test_a_batch_is_of_its_step_the_seed_and_a_hosts_share(folder, tmp_path):
    store, config = ExampleStore(folder), config_of(folder, tmp_path, batch=4, accumulate=2)
    same = example_batch(store, 3, config)
    jax.tree.map(np.testing.assert_array_equal, same, example_batch(ExampleStore(folder), 3, config))
    assert same.seeds.shape == (2, 2, 2) and same.examples.clip.alpha.shape == (2, 2, 2, ROWS, 2 * ROWS)
    for other in (example_batch(store, 4, config), example_batch(store, 3, replace(config, seed=1))):
        assert not np.array_equal(other.seeds, same.seeds)
    once = replace(config, accumulate=1)
    whole, *shares = (example_batch(store, 3, once, host=i, hosts=n) for i, n in ((0, 1), (0, 2), (1, 2)))
    jax.tree.map(lambda w, *s: np.testing.assert_array_equal(w, np.concatenate(s, axis=1)), whole, *shares)
    held_out = [store.example(index).clean_rgb[0] for index in range(2)]
    for step in range(10):
        anchors = example_batch(store, step, config).examples.clean_rgb[:, :, 0].reshape(4, ROWS, 2 * ROWS, 3)
        assert not any(np.array_equal(x, y) for x in anchors for y in held_out)


def test_a_run_that_was_killed_goes_on_to_the_same_parameters(folder, unbroken, tmp_path, monkeypatch):
    config, after = replace(unbroken[0], output=str(tmp_path)), TrainingRun.after

    def killed(run, state, metrics):
        after(run, state, metrics)
        if run.step == 3:
            raise KeyboardInterrupt

    monkeypatch.setattr(TrainingRun, "after", killed)
    with pytest.raises(KeyboardInterrupt):
        train_learned(config)
    monkeypatch.undo()
    with pytest.raises(InputError, match="--resume"):
        train_learned(config)
    state = train_learned(config, resume=True)
    jax.tree.map(np.testing.assert_array_equal, state, unbroken[1])
    assert [line["step"] for line in log_of(tmp_path) if "loss" in line] == [1, 2, 3, 3, 4]  # 2 was the last saved


def test_a_run_writes_its_recipe_log_pictures_and_weights_that_restore(unbroken):
    (config, state), output = unbroken, Path(unbroken[0].output)
    assert load_config(LearnedTrainConfig, output / "config.toml") == config
    records = log_of(output)
    assert [line["step"] for line in records if "loss" in line] == list(range(1, STEPS + 1))
    assert None not in records[0].values() and None not in records[-1].values()  # null is what is not finite
    picture = (output / "samples" / f"{STEPS:06d}.png").read_bytes()
    # Width and height in a PNG's header: four pictures of each of the two clips held out.
    assert struct.unpack(">II", picture[16:24]) == (4 * 2 * ROWS, 2 * ROWS)
    network = read_network(RestoreConfig(method="learned", weights=str(output / "weights.npz"), height=2 * ROWS))
    assert network.config == config.network
    float16 = partial(np.testing.assert_allclose, rtol=2**-11, atol=2**-24)
    jax.tree.map(float16, network.parameters, state.average)


def poisoned(folder, indices):
    """A folder of examples, some of whose positions are not numbers: uint8 colours cannot be."""
    write(folder)
    positions = np.load(folder / "position.npy", mmap_mode="r+")
    positions[indices] = np.nan
    positions.flush()


def test_a_step_with_poisoned_data_is_skipped_and_counted(tmp_path):
    poisoned(tmp_path, [4])
    config, store = config_of(tmp_path, tmp_path / "run"), ExampleStore(tmp_path)
    bad = [np.isnan(example_batch(store, step, config).examples.clip.position).any() for step in range(STEPS)]
    assert 0 < sum(bad) < STEPS
    state = train_learned(config)
    counted = [line["skipped"] for line in log_of(tmp_path / "run") if "loss" in line]
    assert counted == np.cumsum(bad).tolist() and int(state.skipped) == sum(bad)
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(state.parameters))


def test_the_guards_patience_ends_the_run_with_its_checkpoint(tmp_path):
    poisoned(tmp_path, slice(2, None))
    config = config_of(tmp_path, tmp_path / "run", guard=GuardConfig(patience=3))
    with pytest.raises(InputError, match=r"3 steps in a row .* lower optimizer.rate and --resume"):
        train_learned(config)
    assert [line["skipped"] for line in log_of(tmp_path / "run")] == [1, 2]
    assert (tmp_path / "run" / "checkpoints" / "2").is_dir()


REFUSED = {
    "model=magic": 'model "magic" is unknown',
    "data.folder=/none": "/none/rgb.npy cannot be read",
    "steps=5": "--resume it",
    "data.held_out=6": "holds 6 examples, and data.held_out takes 6",
}


@pytest.mark.parametrize("change", REFUSED)
def test_what_cannot_be_trained_is_refused_in_one_line(unbroken, tmp_path, capsys, change):
    recipe, text = tmp_path / "recipe.toml", dump_config(unbroken[0])
    recipe.write_text(text.replace('model = "learned"', 'model = "magic"') if "magic" in change else text)
    assert main(["--config", str(recipe), "--set", change]) == 2
    error = capsys.readouterr().err
    assert REFUSED[change] in error and error.startswith("train_restore: ") and error.count("\n") == 1
