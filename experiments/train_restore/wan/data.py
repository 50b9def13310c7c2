"""Batches of pairs: a function of the seed and the step alone, so that a resumed run gets the same ones. Each epoch has
its own order."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import jax
import numpy as np
from flax import struct

from experiments.train_restore.wan.config import WanTrainConfig
from rein3d_jax.errors import InputError
from rein3d_jax.io.pairs.pair_shard import PairDataset
from rein3d_jax.restore.wan.restore import require_size
from rein3d_jax.restore.wan.windows import padded_length
from rein3d_jax.scene import Pair


@struct.dataclass
class PairBatch:
    """Pairs, with any leading axes, and the randomness of each. sRGB in [0, 1]."""

    clean: jax.Array  # (..., t, h, w, 3)
    rgb: jax.Array  # (..., t, h, w, 3) degraded
    alpha: jax.Array  # (..., t, h, w)
    seed: jax.Array  # (..., 2) uint32 key data


def pair_batches(
    pairs: PairDataset, first: int, config: WanTrainConfig, *, host: int = 0, hosts: int = 1
) -> Iterator[PairBatch]:
    """This host's shares (accumulate, b, ...) of steps `first` on, NumPy; the next is read while one is at work."""
    with ThreadPoolExecutor(1) as reader:
        coming = reader.submit(pair_batch, pairs, first, config, host, hosts)
        for step in range(first + 1, config.steps + 1):
            ready = coming.result()
            coming = reader.submit(pair_batch, pairs, step, config, host, hosts)
            yield ready


def pair_batch(pairs: PairDataset, step: int, config: WanTrainConfig, host: int, hosts: int) -> PairBatch:
    """This host's share of one step."""
    share = slice(host * config.batch // hosts, (host + 1) * config.batch // hosts)
    random = np.random.default_rng((config.seed, step))
    seeds = random.integers(0, 2**32, (config.batch, 2), np.uint32)[share]
    chosen = [_place(index, pairs, config) for index in range(step * config.batch, (step + 1) * config.batch)][share]
    clips = [seeded_pair(pairs[index], seed) for index, seed in zip(chosen, seeds, strict=True)]
    return jax.tree.map(lambda *x: np.stack(x).reshape(config.accumulate, -1, *x[0].shape), *clips)


def seeded_pair(pair: Pair, seed: np.ndarray) -> PairBatch:
    """One pair as the network's training takes it."""
    return PairBatch(pair.clean.rgb, pair.degraded.rgb, pair.degraded.alpha, seed)


def open_pairs(config: WanTrainConfig) -> PairDataset:
    """Pairs of config.data. Raises InputError where there are too few pairs, or where they are not of whole tokens."""
    pairs = PairDataset(config.data.folder)
    if len(pairs) <= config.data.held_out:
        raise InputError(f"{pairs.folder} holds {len(pairs)} pairs, and data.held_out takes {config.data.held_out}")
    frames, height, width = pairs[0].degraded.alpha.shape
    require_size(height, width, config.network)
    if padded_length(frames) != frames:
        raise InputError(f"{pairs.folder} has clips of {frames} frames: build them with 1 + 4 n (pairs.frames)")
    return pairs


def _place(index: int, pairs: PairDataset, config: WanTrainConfig) -> int:
    """Number of the pair that is `index`th to be trained on."""
    count = len(pairs) - config.data.held_out
    epoch, place = divmod(index, count)
    return config.data.held_out + int(np.random.default_rng((config.seed, epoch)).permutation(count)[place])
