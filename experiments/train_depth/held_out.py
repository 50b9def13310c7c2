"""Held-out evaluation of the distance network."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from experiments.train_depth.config import DepthTrainConfig
from experiments.train_depth.data import DepthData, as_floats
from experiments.train_restore.run import HeldOut
from rein3d_jax.depth.network.config import DepthNetworkConfig
from rein3d_jax.depth.network.loss import DepthExample
from rein3d_jax.depth.network.network import estimate_depth
from rein3d_jax.evaluate.distance_error import distance_errors

_SHOWN = 4  # examples in the picture
_MOST = 32  # rendered examples that are evaluated during training


def score_depth(data: DepthData, parameters: dict, config: DepthTrainConfig) -> HeldOut:
    """Mean errors on rooms that are not trained on; the score is -AbsRel, of rendered rooms where there are any."""
    sets = {"drawn": data.drawn_held_out()}
    if data.rendered:
        sets["rendered"] = [as_floats(example) for example in data.rendered.held_out[:_MOST]]
    sets = {name: examples for name, examples in sets.items() if examples}
    figures, rows = {}, []
    for name, examples in sets.items():
        maps = [estimated_distance(parameters, jnp.asarray(x.rgb), config.network) for x in examples]
        scores = [example_errors(x, np.asarray(y)) for x, y in zip(examples, maps, strict=True)]
        abs_rel, delta = np.mean(scores, axis=0)
        figures |= {f"{name}_abs_rel": abs_rel, f"{name}_delta": delta}
        rows += [_row(x, np.asarray(y)) for x, y in zip(examples[:_SHOWN], maps, strict=False)]
    summary = "  ".join(f"{name} {value:.4f}" for name, value in figures.items())
    last = list(sets)[-1]
    return HeldOut(-float(figures[f"{last}_abs_rel"]), figures, np.concatenate(rows), summary)


@partial(jax.jit, static_argnames="config")
def estimated_distance(parameters: dict, rgb: jax.Array, config: DepthNetworkConfig) -> jax.Array:
    """Distance over the camera's height (h, w) of one panorama (h, w, 3)."""
    return jnp.exp(estimate_depth(parameters, rgb[None], config).log_distance[0])


def example_errors(example: DepthExample, estimate: np.ndarray) -> tuple[float, float]:
    """AbsRel, and the share within a factor 1.25."""
    errors = distance_errors(estimate, example.distance, example.distance > 0)
    return float(errors.abs_rel), float(errors.delta)


def _row(example: DepthExample, estimate: np.ndarray) -> np.ndarray:
    """The picture, its true and its estimated distance, near ones bright."""
    grey = [np.where(x > 0, np.clip(0.7 / np.maximum(x, 0.05), 0, 1), 0) for x in (example.distance, estimate)]
    return np.concatenate([example.rgb, *(np.repeat(x[..., None], 3, -1) for x in grey)], axis=1)
