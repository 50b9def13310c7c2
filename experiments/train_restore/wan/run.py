"""The full-size network's training run: its held-out evaluation, a picture of it, and its weights."""

from functools import partial
from typing import Any

import jax
import numpy as np

from experiments.train_restore.guarded_step import TrainState
from experiments.train_restore.run import HeldOut, TrainingRun
from experiments.train_restore.wan.config import WanTrainConfig
from experiments.train_restore.wan.data import PairBatch, seeded_pair
from experiments.train_restore.wan.step import FixedState, WanState, adapted, pairs_loss
from rein3d_jax.io.pairs.pair_shard import PairDataset
from rein3d_jax.networks.wan import write_wan
from rein3d_jax.parallel import gather
from rein3d_jax.restore.blend import blend
from rein3d_jax.restore.wan.restore import DegradedClip, DiffusionConfig, WanParams, clip_noise, restore_frames
from rein3d_jax.scene import Pair

_OBSERVED = 0.5  # alpha from which a pixel counts as observed, RestoreConfig's default
_SHOWN = 3  # frames in a picture, the last one and those before it at even distances


class WanRun(TrainingRun):
    """A TrainingRun on a PairDataset, whose score is the held-out loss, with its sign turned; each pair always meets
    the same noise."""

    def after(self, state: WanState, metrics: dict[str, jax.Array]) -> None:
        """A step is done. Raises InputError when too many in a row were refused."""
        self.fixed = state.fixed
        super().after(state.train, metrics)

    def _evaluate(self, state: TrainState) -> None:
        self.fixed = gather(self.fixed)  # all hosts' work
        super()._evaluate(state)

    def held_out(self, average: Any) -> HeldOut:
        """Evaluation of averaged parameters on the pairs held out."""
        loss = held_out_loss(self.data, average, self.fixed, self.config)
        grid, psnr = held_out_picture(self.data[0], self._params(average), self.config)
        figures = {"held_out_loss": loss, "held_out_psnr": psnr}
        summary = f"held-out loss {loss:.4f}, holes of the first held-out clip {psnr:.2f} dB"
        return HeldOut(-loss, figures, grid, summary)

    def write_weights(self, average: Any) -> None:
        """Writes the folder weights/ of averaged parameters."""
        write_wan(self.output / "weights", self._params(average), self.config.network)

    def _params(self, average: Any) -> WanParams:
        return adapted(average, self.fixed, self.config)


def held_out_loss(pairs: PairDataset, trained: Any, fixed: FixedState, config: WanTrainConfig) -> float:
    """Mean over the held-out pairs, each at a noise level and noise of its own that stay the same."""
    sums = np.zeros(2)
    for index in range(config.data.held_out):
        pair = jax.tree.map(lambda x: np.asarray(x)[None], seeded_pair(pairs[index], np.array([0, index], np.uint32)))
        sums += np.array(_loss(trained, pair, fixed, config))
    return float(sums[0] / sums[1])


def held_out_picture(pair: Pair, params: WanParams, config: WanTrainConfig) -> tuple[np.ndarray, float]:
    """Some frames of the pair: rendered, restored, clean; and the PSNR of the restored holes, nan if there are none."""
    video, (key_noise, key_yaw) = pair.degraded, jax.random.split(jax.random.key(config.seed))
    diffusion = DiffusionConfig(config.network, config.sampling)
    noise = clip_noise(key_noise, video.alpha.shape, diffusion)
    clip = DegradedClip(video.rgb, video.alpha, pair.clean.rgb[0])
    drawn = restore_frames(key_yaw, params, clip, noise, diffusion)
    restored = np.asarray(blend(drawn, video.rgb, video.alpha, observed=_OBSERVED))
    hole = pair.degraded.alpha < _OBSERVED
    error = np.mean((restored - pair.clean.rgb)[hole] ** 2) if hole.any() else np.nan
    rows = [
        np.concatenate([(pair.degraded.rgb * ~hole[..., None])[index], restored[index], pair.clean.rgb[index]], axis=1)
        for index in np.linspace(0, len(hole) - 1, _SHOWN + 1).astype(int)[1:]
    ]
    return np.concatenate(rows, axis=0), float(-10 * np.log10(error))


@partial(jax.jit, static_argnames="config")
def _loss(trained, pair: PairBatch, fixed: FixedState, config: WanTrainConfig):
    return pairs_loss(trained, pair, fixed=fixed, config=config)
