"""An ablation: every variant with every seed, once."""

import json

import numpy as np
import pytest

from experiments.ablate import __main__ as ablate
from experiments.example_store import write_examples
from rein3d_jax.restore.learned.condition import CANDIDATES, Clip
from rein3d_jax.restore.learned.loss import Example

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("one_step_a_config")]  # whole trainings

ROWS, FRAMES = 16, 2
RECIPE = """
model = "learned"
steps = 1
batch = 1
evaluate_every = 1
save_every = 1
[optimizer]
warmup = 0
[network]
rows = 16
fine = 8
width = 8
depth = 1
heads = 1
expand = 1
[data]
frames = 2
held_out = 1
"""
TABLE = """
[ablation]
seeds = [0, 1]
sampler_steps = [1, 2]
[ablation.variants]
full = []
alone = ["network.anchor=false"]
"""


def example(index: int) -> Example:
    rng, shape = np.random.default_rng(index), (FRAMES, ROWS, 2 * ROWS)

    def values(*channels):
        return rng.random((*shape, *channels), np.float32)

    alpha = (values() < 0.7).astype(np.float32)
    clip = Clip(
        values(3), alpha, 1 + values(), values(CANDIDATES, 3), 1 + values(CANDIDATES), np.zeros((FRAMES, 3), np.float32)
    )
    return Example(clip, values(3), 1 + values())


def run(folder, text):
    (folder / "recipe.toml").write_text(text)
    options = ["--set", f"output={folder}/runs", "--set", f"data.folder={folder}/examples"]
    return ablate.main(["--config", str(folder / "recipe.toml"), "--json", str(folder / "out.json"), *options])


def test_every_variant_is_trained_with_every_seed_and_once(tmp_path, monkeypatch):
    list(write_examples(tmp_path / "examples", example, 3))
    assert run(tmp_path, RECIPE + TABLE) == 0
    found = json.loads((tmp_path / "out.json").read_text())["variants"]
    assert set(found) == {"full", "alone"}
    for scores in found.values():
        gain = scores["gain_2"]
        assert len(gain["seeds"]) == 2 and np.isclose(gain["mean"], np.mean(gain["seeds"]))
        assert np.isclose(gain["sem"], np.abs(np.subtract(*gain["seeds"])) / 2)  # of two: half their difference
    monkeypatch.setattr(ablate, "train_learned", lambda *_, **__: pytest.fail("trained again"))
    assert run(tmp_path, RECIPE + TABLE) == 0
    assert json.loads((tmp_path / "out.json").read_text())["variants"] == found


@pytest.mark.parametrize("table", ["", "[ablation]\nvariant = 1\n"])
def test_a_recipe_without_variants_is_refused(tmp_path, capsys, table):
    assert run(tmp_path, RECIPE + table) == 2
    assert "[ablation] needs a table `variants`" in capsys.readouterr().err
