"""How well the averaged parameters restore the clips that were held out, and pictures of it."""

import jax
import jax.numpy as jnp
import numpy as np

from experiments.example_store import ExampleStore
from experiments.train_restore.config import TrainConfig
from rein3d_jax.geometry.sphere import latitudes
from rein3d_jax.restore.learned.loss import Example
from rein3d_jax.restore.learned.sample import Learned, sample

SHOWN = 4  # clips in the grid
OPEN = 0.5  # alpha below which a pixel is a hole
NAMES = ("held_out_psnr", "held_out_gain", "held_out_ws_gain")


def restored(learned: Learned, example: Example, steps: int) -> jax.Array:
    """The colours (t, h, w, 3) of one example (t, h, w), its holes redrawn."""
    out = sample(jax.random.key(0), learned, jax.tree.map(jnp.asarray, example.clip), steps)
    return jnp.where((example.clip.alpha < OPEN)[..., None], jnp.clip(out[..., :3], 0, 1), example.clip.rgb)


def evaluate(
    store: ExampleStore, parameters: dict, config: TrainConfig, *, steps: int = 1
) -> tuple[dict[str, float], np.ndarray]:
    """After so many sampler steps: mean hole PSNR over the held-out clips that have holes, and its gain over the
    background fill, in dB, also by area on the sphere (`ws`); and a grid of the last frames: rendered, filled,
    restored, clean."""
    scores, rows, learned = [], [], Learned(parameters, config.network)
    store = ExampleStore(config.data.validation) if config.data.validation else store
    for index in range(min(config.data.held_out, len(store))):
        example = store.example(index)
        rgb = restored(learned, example, steps)
        hole = jnp.asarray(example.clip.alpha < OPEN).at[0].set(False)  # the anchor does not count
        area = hole * jnp.cos(latitudes(hole.shape[1]))[:, None]
        mine, fill = (
            [_psnr(x, example.clean_rgb, w) for w in (hole, area)] for x in (rgb, example.clip.fill_rgb[..., 0, :])
        )
        scores.append([mine[0], mine[0] - fill[0], mine[1] - fill[1]])
        if index < SHOWN:
            clip, last = example.clip, -1
            shown = clip.rgb[last] * clip.alpha[last][..., None]
            rows.append([shown, clip.fill_rgb[last, ..., 0, :], np.asarray(rgb[last]), example.clean_rgb[last]])
    means = np.mean([score for score in np.array(scores, float) if np.isfinite(score).all()], axis=0)
    grid = np.concatenate([np.concatenate(row, axis=1) for row in rows], axis=0)
    return dict(zip(NAMES, means.tolist(), strict=True)), grid


def _psnr(rgb: jax.Array, clean: jax.Array, where: jax.Array) -> jax.Array:
    squared = jnp.mean((rgb - clean) ** 2, axis=-1)
    return -10 * jnp.log10(jnp.sum(squared * where) / jnp.sum(where))
