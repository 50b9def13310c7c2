"""Held-out evaluation of the learned restorer: figures and pictures of the clips that were not trained on."""

import jax
import jax.numpy as jnp
import numpy as np

from experiments.example_store import ExampleStore
from experiments.train_restore.learned.config import LearnedTrainConfig
from rein3d_jax.geometry.sphere import latitudes
from rein3d_jax.restore.learned.loss import Example
from rein3d_jax.restore.learned.sample import Learned, sample_clip

_SHOWN = 4  # clips in the grid
_OPEN = 0.5  # alpha below which a pixel is a hole
_FIGURES = ("held_out_psnr", "held_out_gain", "held_out_ws_gain")


def restored_colours(learned: Learned, example: Example, steps: int) -> jax.Array:
    """Colours (t, h, w, 3) of one example (t, h, w), its holes redrawn."""
    out = sample_clip(jax.random.key(0), learned, jax.tree.map(jnp.asarray, example.clip), steps)
    return jnp.where((example.clip.alpha < _OPEN)[..., None], jnp.clip(out[..., :3], 0, 1), example.clip.rgb)


def score_held_out(
    store: ExampleStore, parameters: dict, config: LearnedTrainConfig, *, steps: int = 1
) -> tuple[dict[str, float], np.ndarray]:
    """Mean hole PSNR over the held-out clips that have holes, and its gain over the background fill, in dB, also by
    area on the sphere (`ws`), after so many sampler `steps`; and a grid of the last frames: rendered, filled,
    restored, clean."""
    scores, rows, learned = [], [], Learned(parameters, config.network)
    store = ExampleStore(config.data.validation) if config.data.validation else store
    for index in range(min(config.data.held_out, len(store))):
        example = store.example(index)
        rgb = restored_colours(learned, example, steps)
        hole = jnp.asarray(example.clip.alpha < _OPEN).at[0].set(False)  # the anchor does not count
        area = hole * jnp.cos(latitudes(hole.shape[1]))[:, None]
        mine, fill = (
            [_psnr(x, example.clean_rgb, w) for w in (hole, area)] for x in (rgb, example.clip.fill_rgb[..., 0, :])
        )
        scores.append([mine[0], mine[0] - fill[0], mine[1] - fill[1]])
        if index < _SHOWN:
            clip, last = example.clip, -1
            shown = clip.rgb[last] * clip.alpha[last][..., None]
            rows.append([shown, clip.fill_rgb[last, ..., 0, :], np.asarray(rgb[last]), example.clean_rgb[last]])
    means = np.mean([score for score in np.array(scores, float) if np.isfinite(score).all()], axis=0)
    grid = np.concatenate([np.concatenate(row, axis=1) for row in rows], axis=0)
    return dict(zip(_FIGURES, means.tolist(), strict=True)), grid


def _psnr(rgb: jax.Array, clean: jax.Array, where: jax.Array) -> jax.Array:
    squared = jnp.mean((rgb - clean) ** 2, axis=-1)
    return -10 * jnp.log10(jnp.sum(squared * where) / jnp.sum(where))
