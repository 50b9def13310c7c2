"""How well the averaged parameters restore the clips that were held out, and pictures of it."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from experiments.example_store import ExampleStore
from experiments.train_config import TrainConfig
from rein3d_jax.restore.learned.config import NetworkConfig
from rein3d_jax.restore.learned.loss import Example
from rein3d_jax.restore.learned.mixture import base
from rein3d_jax.restore.learned.predict import predict

SHOWN = 4  # clips in the grid


@partial(jax.jit, static_argnames="config")
def restored(parameters: dict, example: Example, config: NetworkConfig) -> tuple[jax.Array, jax.Array, jax.Array]:
    """One example (t, h, w) -> (colours (t, h, w, 3), hole PSNR of them in dB, of the first fill); the anchor left
    out of both."""
    clip = jax.tree.map(lambda x: x[None], example.clip)
    noisy = jnp.zeros((*clip.alpha.shape, 4))
    out = (predict(parameters, clip, noisy, jnp.ones(1), config=config) + base(clip))[0]
    hole = (example.clip.alpha < 0.5).at[0].set(False)
    rgb = jnp.where(hole[..., None], jnp.clip(out[..., :3], 0, 1), example.clip.rgb)
    return rgb, _psnr(rgb, example.clean_rgb, hole), _psnr(example.clip.fill_rgb[..., 0, :], example.clean_rgb, hole)


def evaluate(store: ExampleStore, parameters: dict, config: TrainConfig) -> tuple[dict[str, float], np.ndarray]:
    """Mean hole PSNR over the held-out clips that have holes, and its gain over the background fill, in dB; and a grid
    of the last frames: rendered, filled, restored, clean."""
    scores, rows = [], []
    store = ExampleStore(config.data.validation) if config.data.validation else store
    for index in range(min(config.data.held_out, len(store))):
        example = store.example(index)
        rgb, mine, fill = restored(parameters, example, config.network)
        scores.append((float(mine), float(mine - fill)))
        if index < SHOWN:
            clip, last = example.clip, -1
            shown = clip.rgb[last] * clip.alpha[last][..., None]
            rows.append([shown, clip.fill_rgb[last, ..., 0, :], np.asarray(rgb[last]), example.clean_rgb[last]])
    psnr, gain = np.mean([score for score in scores if np.isfinite(score).all()], axis=0)
    grid = np.concatenate([np.concatenate(row, axis=1) for row in rows], axis=0)
    return {"held_out_psnr": psnr, "held_out_gain": gain}, grid


def _psnr(rgb: jax.Array, clean: jax.Array, where: jax.Array) -> jax.Array:
    squared = jnp.mean((rgb - clean) ** 2, axis=-1)
    return -10 * jnp.log10(jnp.sum(squared * where) / jnp.sum(where))
