"""Batches of examples: a function of the seed and the step, so that a resumed run gets the same ones."""

import jax
import numpy as np

from experiments.example_store import ExampleStore
from experiments.train_restore.learned.config import LearnedTrainConfig
from experiments.train_restore.learned.step import ExampleBatch

_MIN_HOLES = 0.003  # share of holes that an example without any counts as having


def example_batch(
    store: ExampleStore, step: int, config: LearnedTrainConfig, *, host: int = 0, hosts: int = 1
) -> ExampleBatch:
    """This host's share of step `step`'s examples, NumPy. Examples are drawn by the root of their share of holes: the
    rest teaches nothing, and the root still draws small holes. A store that is being written is drawn from as far as it
    goes, and only a finished one gives the same batches again."""
    random = np.random.default_rng((config.seed, step))
    first, count = config.data.held_out, len(store)
    weights = np.sqrt(store.open_fractions(count)[first:] + _MIN_HOLES)
    chosen = first + random.choice(count - first, config.batch, p=weights / weights.sum())
    frames = [_frames(random, store.frames, config.data.frames) for _ in chosen]
    seeds = random.integers(0, 2**32, (config.batch, 2), np.uint32)
    share = slice(host * config.batch // hosts, (host + 1) * config.batch // hosts)
    examples = [store.example(*pair) for pair in zip(chosen[share], frames[share], strict=True)]
    parts = (config.accumulate, -1)
    return jax.tree.map(
        lambda x: x.reshape(*parts, *x.shape[1:]),
        ExampleBatch(jax.tree.map(lambda *x: np.stack(x), *examples), seeds[share]),
    )


def _frames(random: np.random.Generator, there: int, wanted: int) -> np.ndarray:
    """The anchor and wanted - 1 of the others, in order."""
    others = random.choice(np.arange(1, there), min(wanted, there) - 1, replace=False)
    return np.concatenate([[0], np.sort(others)])
