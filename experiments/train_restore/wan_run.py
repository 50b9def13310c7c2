"""How well the full-size network's averaged parameters do on the pairs that were held out, and a picture of it."""

from functools import partial
from pathlib import Path

import jax
import numpy as np

from experiments.train_restore.run import TrainingRun
from experiments.train_restore.wan_config import WanTrainConfig
from experiments.train_restore.wan_data import Clips, clip_of
from experiments.train_restore.wan_step import WanState, adapted, clips_loss
from experiments.wan_weights import write_wan
from rein3d_jax.io.pairs.pair_shard import PairDataset
from rein3d_jax.io.pictures.image import write_rgb
from rein3d_jax.parallel import gather
from rein3d_jax.restore.blend import blend
from rein3d_jax.restore.wan.restore import WanParams, clip_noise, restore_frames
from rein3d_jax.scene import Pair

OBSERVED = 0.5  # alpha from which a pixel counts as observed, RestoreConfig's default
SHOWN = 3  # frames in a picture, the last one and those before it at even distances


class WanRun(TrainingRun):
    """A TrainingRun whose score is the held-out loss, with its sign turned; each pair always meets the same noise."""

    def after(self, state: WanState, metrics: dict[str, jax.Array]) -> None:
        """A step is done. Raises InputError when too many in a row were refused."""
        self.fixed = state.fixed
        super().after(state.train, metrics)

    def _evaluate(self, train) -> None:
        state, average = WanState(None, gather(self.fixed)), gather(train.average)
        if not self.writes:
            return
        loss = held_out_loss(self.store, average, state, self.config)
        params = adapted(average, state, self.config)
        grid, psnr = held_out_picture(self.store[0], params, self.config)
        self.score = -loss
        self.log.record(self.step, {"held_out_loss": loss, "held_out_psnr": psnr})
        self.log.picture(self.step, "held_out", grid)
        write_rgb(self.output / "samples" / f"{self.step:06d}.png", grid)
        if self.score > self.best:
            self.best = self.score
            write_wan(Path(self.output) / "weights", params, self.config.network)
        print(f"step {self.step}  held-out loss {loss:.4f}, holes of the first held-out clip {psnr:.2f} dB", flush=True)


def held_out_loss(pairs: PairDataset, trained, state: WanState, config: WanTrainConfig) -> float:
    """Mean over the held-out pairs, each at a noise level and noise of its own that stay the same."""
    sums = np.zeros(2)
    for index in range(config.data.held_out):
        clip = jax.tree.map(lambda x: np.asarray(x)[None], clip_of(pairs[index], np.array([0, index], np.uint32)))
        sums += np.array(_loss(trained, clip, state.fixed, config))
    return float(sums[0] / sums[1])


def held_out_picture(pair: Pair, params: WanParams, config: WanTrainConfig) -> tuple[np.ndarray, float]:
    """Some frames of the pair: rendered, restored, clean; and the PSNR of the restored holes, nan if there are none."""
    video, (key_noise, key_turn) = pair.degraded, jax.random.split(jax.random.key(config.seed))
    noise = clip_noise(key_noise, video.alpha.shape, config.network, config.sampling.noise)
    given = (video.rgb, video.alpha, pair.clean.rgb[0], noise)
    drawn = restore_frames(key_turn, params, *given, config=config.network, sampling=config.sampling)
    restored = np.asarray(blend(drawn, video.rgb, video.alpha, observed=OBSERVED))
    hole = pair.degraded.alpha < OBSERVED
    error = np.mean((restored - pair.clean.rgb)[hole] ** 2) if hole.any() else np.nan
    rows = [
        np.concatenate([(pair.degraded.rgb * ~hole[..., None])[index], restored[index], pair.clean.rgb[index]], axis=1)
        for index in np.linspace(0, len(hole) - 1, SHOWN + 1).astype(int)[1:]
    ]
    return np.concatenate(rows, axis=0), float(-10 * np.log10(error))


@partial(jax.jit, static_argnames="config")
def _loss(trained, clip: Clips, fixed, config: WanTrainConfig):
    return clips_loss(trained, clip, fixed=fixed, config=config)
